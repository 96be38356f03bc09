"""Road users ahead on the ego's course: headway, and what avoiding them would take.

The course is the circle of the ego's present yaw rate and speed; of one that backs, the rear is its
front. Ahead on it are those that overlap the strip that the ego would sweep, not driven against it
or across it. What avoiding them takes is asked while there is a gap: once outlines touch, nothing
avoids it any more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.geometry.steering import MAX_CURVATURE_PM
from foretwin.sim_worker.driver_model import ALONG_COS, STANDING_MPS
from foretwin.sim_worker.metrics import compiled_pairs
from foretwin.sim_worker.metrics.comfort import ACCEL_WINDOW_S
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView

_SLOW_MPS = 1.0
"""Below this speed a yaw rate says nothing about the course, which is then taken as straight."""
_MOVES_MPS = 0.1
"""An ego slower than this has no headway in time."""
_ROUNDING_MPS = 1e-9
"""Speeds along the course that differ by less are the same."""


class Leaders(NamedTuple):
    """K pairs of an instant and a road user ahead on the course.

    `row` (K,) is future times N + instant; `gap_m` (K,) from the ego's front to the other's
    nearest end along the course; `left_m` (K,) of the other's middle; `reach_m` (K,) half of both
    widths; speeds (K,) along and across the course; `accel_mps2` (K,) of the other along it.
    """

    row: Indices
    gap_m: Array
    left_m: Array
    reach_m: Array
    ego_mps: Array
    other_mps: Array
    other_left_mps: Array
    accel_mps2: Array


def time_headway(view: RolloutView) -> Measure:
    """Least time headway (S,), infinite where none is ahead or the ego stands.

    Seconds until the ego's front is where the leader's rear is now: Jansson (2005), Collision
    Avoidance Theory, section 5.3.1; Westhofen et al. (2023), Criticality Metrics for Automated
    Driving, THW.
    """
    ahead = view.keep(leaders)
    moving = ahead.ego_mps > _MOVES_MPS
    headway = np.where(moving, ahead.gap_m, np.inf) / np.where(moving, ahead.ego_mps, 1.0)
    return extreme(view, ahead, headway, np.minimum, np.inf)


def drac(view: RolloutView) -> Measure:
    """Greatest deceleration rate to avoid the crash (S,), 0 where none is approached.

    Cooper and Ferguson (1976), Traffic studies at T-junctions; (v - v_leader)² / (2 gap) in
    Archer (2005), Indicators for traffic safety assessment and prediction, equation 4.
    """
    return _greatest(view, _drac)


def required_deceleration(view: RolloutView) -> Measure:
    """Greatest deceleration (S,) that matches the leader's speed just before touching it.

    Jansson (2005), Collision Avoidance Theory, section 5.3.5: the leader keeps its acceleration,
    who brakes until it stands; 0 where none is approached. Positive here, negative in the source.
    """
    return _greatest(view, _longitudinal)


def required_lateral_acceleration(view: RolloutView) -> Measure:
    """Greatest lateral acceleration (S,) that gets past the leader just before touching it.

    Jansson (2005), Collision Avoidance Theory, section 5.3.8, to the easier side.
    """
    return _greatest(view, _lateral)


def required_acceleration(view: RolloutView) -> Measure:
    """Greatest root sum of squares (S,) of the two above, taken at the same instant.

    Jansson (2005), Collision Avoidance Theory, section 5.3.10.
    """
    return _greatest(view, lambda ahead: np.hypot(_longitudinal(ahead), _lateral(ahead)))


def leaders(view: RolloutView) -> Leaders:
    """Return all road users ahead on the ego's course at some instant.

    With κ the curvature, a point at (x, y) of base_link's axes lies ((1 - r) / κ) to the left of
    the circle and atan2(κ x, 1 - κ y) / κ along it, where r² = (κ x)² + (1 - κ y)². Axes of an ego
    that backs are turned round.
    """
    seen = view.relative
    towards = np.where(view.backs, -1.0, 1.0)
    speed = towards * view.states[..., 3]
    curvature = np.where(
        np.abs(speed) > _SLOW_MPS, view.states[..., 5] / np.maximum(np.abs(speed), _SLOW_MPS), 0.0
    )
    curvature = np.clip(curvature, -MAX_CURVATURE_PM, MAX_CURVATURE_PM)
    pairs = np.empty(seen.ahead_m.size, dtype=np.intp)
    found = np.empty((5, len(pairs)))
    limits = (view.centre_ahead_m, *view.half_m, ALONG_COS, STANDING_MPS)
    relative = (*seen[:4], seen.speed_mps)
    count = compiled_pairs.find_leaders(
        relative, view.user_half_m, curvature, towards, limits, pairs, found
    )
    pair = pairs[:count]
    gap, left, reach, turned_cos, turned_sin = found[:, :count]
    row, user = np.divmod(pair, max(seen.ahead_m.shape[2], 1))
    other = seen.speed_mps.reshape(-1)[pair]
    return Leaders(
        row=row,
        gap_m=gap,
        left_m=left,
        reach_m=reach,
        ego_mps=speed.reshape(-1)[row],
        other_mps=other * turned_cos,
        other_left_mps=other * turned_sin,
        accel_mps2=_user_acceleration(view, row, user) * turned_cos,
    )


def _user_acceleration(view: RolloutView, row: Indices, user: Indices) -> Array:
    """Return the accelerations (K,) of road users, 0 for who stands or is there but once.

    The slope of the line through the speeds within half a window, which in its middle is that of
    the quadratic of `comfort.motion`: differences of two instants would multiply their noise.
    """
    speed, time_s = view.rollout.user_speed_mps, view.time_s
    instants = len(time_s)
    future, instant = np.divmod(row, instants)
    reach = min(max(round(ACCEL_WINDOW_S / 2.0 / float(np.diff(time_s).mean())), 1), instants - 1)
    count, sum_s, sum_mps, sum_ss, sum_m = np.zeros((5, len(row)))
    now_mps = speed[future, instant, user]
    for step in range(-reach, reach + 1):
        at = np.clip(instant + step, 0, instants - 1)
        gain = speed[future, at, user] - now_mps
        counts = np.isfinite(gain) & (at == instant + step)
        later_s, gain = (
            np.where(counts, time_s[at] - time_s[instant], 0.0),
            np.where(counts, gain, 0.0),
        )
        count += counts
        sum_s += later_s
        sum_mps += gain
        sum_ss += later_s * later_s
        sum_m += later_s * gain
    spread = count * sum_ss - sum_s * sum_s
    sloping = (spread > 0.0) & (np.abs(now_mps) >= STANDING_MPS)
    slope = (count * sum_m - sum_s * sum_mps) / np.where(sloping, spread, 1.0)
    return np.where(sloping, slope, 0.0)


def closing_mps(ahead: Leaders) -> Array:
    """Return how fast the ego nears each leader (K,) along the course, 0 where it does not."""
    closing = ahead.ego_mps - ahead.other_mps
    return np.where(closing > _ROUNDING_MPS, closing, 0.0)


def aside_to_pass(ahead: Leaders, until_s: Array) -> Array:
    """Return how far to the easier side (K,) the ego has to get to pass leaders `until_s` later."""
    then_left = ahead.left_m + ahead.other_left_mps * until_s
    return np.asarray(np.maximum(ahead.reach_m - np.abs(then_left), 0.0))


def _greatest(view: RolloutView, needed: Callable[[Leaders], Array]) -> Measure:
    """Return the greatest of `needed` (K,) of leaders at a gap (S,), 0 where none is approached.

    Invalid where somebody is approached only after the outlines touch: at no gap, no rate avoids
    it.
    """
    ahead = view.keep(leaders)
    apart = ahead.gap_m > 0.0
    found = extreme(view, _of(ahead, apart), needed(_of(ahead, apart)), np.maximum, 0.0)
    too_late = np.zeros(len(view.valid), dtype=bool)
    too_late[ahead.row[~apart & (closing_mps(ahead) > 0.0)] // view.states.shape[1]] = True
    return view.measure(found.values, ~(too_late & (found.values == 0.0)))


def _of(ahead: Leaders, which: Flags) -> Leaders:
    return Leaders._make(values[which] for values in ahead)


def _drac(ahead: Leaders) -> Array:
    return np.asarray(np.square(closing_mps(ahead)) / (2.0 * ahead.gap_m))


def _longitudinal(ahead: Leaders) -> Array:
    closing = closing_mps(ahead)
    nears, other = closing > 0.0, np.maximum(ahead.other_mps, 0.0)
    brakes = np.maximum(-ahead.accel_mps2, 0.0)
    # Speeds match after 2 gap / closing, if the leader still drives then.
    stands_first = brakes * 2.0 * ahead.gap_m > other * closing
    matching = _drac(ahead) - ahead.accel_mps2
    to_stand_m = np.square(other) / (2.0 * np.where(brakes > 0.0, brakes, 1.0))
    stopping = np.square(ahead.ego_mps) / (2.0 * (ahead.gap_m + to_stand_m))
    needed = np.where(stands_first, stopping, matching)
    return np.where(nears, np.maximum(needed, 0.0), 0.0)


def _lateral(ahead: Leaders) -> Array:
    closing = closing_mps(ahead)
    nears = closing > 0.0
    until = ahead.gap_m / np.where(nears, closing, 1.0)
    way = aside_to_pass(ahead, until)
    return np.where(nears, 2.0 * way / np.square(until), 0.0)


def extreme(
    view: RolloutView, ahead: Leaders, values: Array, of: np.ufunc, without: float
) -> Measure:
    """Return the smallest or greatest of `values` (K,) of each future, else `without`."""
    futures, instants = view.states.shape[:2]
    found = np.full(futures, without)
    of.at(found, ahead.row // instants, values)
    return view.measure(found)
