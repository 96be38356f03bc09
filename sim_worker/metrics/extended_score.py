"""The extended predictive driver model score of NAVSIM v2, part by part.

Cao et al. (2025), Pseudo-Simulation for Autonomous Driving, appendix, and the definitions of its
published implementation (docs/metrics.md of autonomousvision/navsim, pdm_scorer.py). What differs
here stands in docs/metrics.md; by the parts' tests the verdicts are the same.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.metrics import compiled_pairs
from foretwin.sim_worker.metrics.comfort import comfortable
from foretwin.sim_worker.metrics.lane_areas import LaneAreas
from foretwin.sim_worker.metrics.progress import keeps_to_road, staying
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView
from foretwin.sim_worker.metrics.score import relative_progress
from foretwin.sim_worker.metrics.violations import red_light_violations

PROGRESS_WEIGHT, TTC_WEIGHT, LANE_WEIGHT, COMFORT_WEIGHT = 5.0, 5.0, 2.0, 2.0
STANDS_MPS, TTC_STANDS_MPS = 0.05, 0.005
TTC_AHEAD_S = (0.0, 0.3, 0.6, 0.9)
ONCOMING_S, ONCOMING_M = 1.0, (2.0, 6.0)
OFF_CENTRE_M, OFF_CENTRE_S = 0.5, 2.0
AHEAD_RAD, BEHIND_RAD = np.deg2rad(30.0), np.deg2rad(150.0)
"""All of the published configuration."""
_LANE_HALF_M = 0.9
"""Nearer to the path's middle than this a car is on its route. Chosen: half of a narrow lane."""


class Overlaps(NamedTuple):
    """First overlaps of pairs of a future and a road user (K,) each: at which instant of the ego,
    how many steps later, and where the other is then: `angle_rad` off the way the ego drives, as
    seen from its trailing axle: from base_link, unless it drives backwards."""

    future: Indices
    instant: Indices
    user: Indices
    steps: Indices
    angle_rad: Array


def extended_score(view: RolloutView) -> Measure:
    """Score (S,) from 0 to 1: NC · DAC · DDC · TLC times a weighted mean of progress, time to
    collision, lane keeping and comfort.

    (5 EP + 5 TTC + 2 LK + 2 HC) / 14: without extended comfort, which compares two plans of
    successive frames, as the published scorer leaves it out of what it says of one. No human's
    drive is known that would excuse a violation. Progress is relative to the farthest future.
    """
    gates = no_at_fault(view).values * keeps_to_road(view)
    gates = gates * driving_direction(view).values * traffic_lights(view).values
    parts = (
        (PROGRESS_WEIGHT, relative_progress(view, gates)),
        (TTC_WEIGHT, time_to_collision_kept(view).values),
        (LANE_WEIGHT, lane_keeping(view).values),
        (COMFORT_WEIGHT, comfortable(view).values),
    )
    weighted = sum(weight * values for weight, values in parts)
    return view.measure(gates * weighted / sum(weight for weight, _ in parts))


def no_at_fault(view: RolloutView) -> Measure:
    """NC (S,): 0 where the ego drives into a road user, or beside one while not in one lane.

    At fault is who touches, while it moves, somebody who stands, or anybody with its front;
    from the side only in several lanes or off the road; never who is hit from behind. Outlines
    count at the rows' instants.
    """
    first = view.keep(_overlaps_now)
    moves = np.hypot(view.states[..., 3], view.states[..., 4])[first.future, first.instant]
    there = first.future, first.instant, first.user
    stands = np.abs(view.users[3][there]) <= STANDS_MPS
    behind = first.angle_rad > BEHIND_RAD
    beside = ~_front_touches(view, first) & ~stands
    fault = (moves > STANDS_MPS) & (stands | ~behind)
    lateral = np.flatnonzero(fault & beside)
    fault[lateral] = _astray(view, first.future[lateral], first.instant[lateral])
    return _zero_where(view, first.future[fault])


def time_to_collision_kept(view: RolloutView) -> Measure:
    """TTC (S,): 0 where the ego, going straight on for up to 0.9 s, would touch who is ahead.

    Others are where they come to be. Who is beside counts in junctions, in several lanes or off
    the road; who is behind never does.
    """
    first = view.keep(_overlaps_ahead)
    fault = first.angle_rad < AHEAD_RAD
    beside = np.flatnonzero(~fault & (first.angle_rad <= BEHIND_RAD))
    future, instant = first.future[beside], first.instant[beside]
    astray = _astray(view, future, instant)
    fault[beside] = astray | _lanes(view).in_junction(view.states[future, instant, :2])
    return _zero_where(view, first.future[fault])


def driving_direction(view: RolloutView) -> Measure:
    """DDC (S,): 1 with less than 2 m in a second outside the lanes of the route, ½ below 6 m, or 0.

    Junctions do not count, nor what lies beyond the World's edge.
    """
    lanes, centre = _lanes(view), view.centre_m
    moved = np.zeros(view.states.shape[:2])
    moved[:, 1:] = np.hypot(*np.moveaxis(np.diff(centre, axis=1), 2, 0))
    far = np.flatnonzero((np.abs(view.keep(_beside_path)) > _LANE_HALF_M) & (moved > 0.0))
    astray = np.zeros(moved.size, dtype=bool)
    if len(far):
        points = centre.reshape(-1, 2)[far]
        route = lanes.route(_path(view))
        known = lanes.extent.holds(points) & ~lanes.in_junction(points)
        astray[far] = known & ~lanes.on_route(points, route)
    total = np.cumsum(moved * astray.reshape(moved.shape), axis=1)
    steps = int(ONCOMING_S / _step_s(view) + 1e-9)
    before = np.zeros_like(total)
    before[:, steps + 1 :] = total[:, : -(steps + 1)]
    most = (total - before).max(axis=1)
    least, violated = ONCOMING_M
    return view.measure(np.where(most < least, 1.0, np.where(most < violated, 0.5, 0.0)))


def traffic_lights(view: RolloutView) -> Measure:
    """TLC (S,): 0 where the ego's front crosses a stop line at red."""
    return view.measure((red_light_violations(view).values == 0.0).astype(np.float64))


def lane_keeping(view: RolloutView) -> Measure:
    """LK (S,): 0 where the middle is for 2 s on end more than 0.5 m beside the path.

    What is in a junction counts neither for nor against it.
    """
    off = np.abs(view.keep(_beside_path)) > OFF_CENTRE_M
    skipped = np.zeros(off.shape, dtype=bool)
    rows = np.flatnonzero(off.any(axis=1))
    if len(rows):
        points = view.centre_m[rows]
        inside = _lanes(view).in_junction(points.reshape(-1, 2))
        skipped[rows] = inside.reshape(points.shape[:2])
    needed = int(np.ceil(OFF_CENTRE_S / _step_s(view) - 1e-9))
    streak = np.zeros(len(off), dtype=np.intp)
    longest = streak.copy()
    for at in range(off.shape[1]):
        streak = np.where(skipped[:, at], streak, np.where(off[:, at], streak + 1, 0))
        longest = np.maximum(longest, streak)
    return view.measure((longest < needed).astype(np.float64))


def _overlaps_now(view: RolloutView) -> Overlaps:
    return _first_overlaps(view, np.zeros(1, dtype=np.intp), 0.0)


def _overlaps_ahead(view: RolloutView) -> Overlaps:
    later = np.round(np.array(TTC_AHEAD_S) / _step_s(view)).astype(np.intp)
    return _first_overlaps(view, later[later < len(view.time_s)], TTC_STANDS_MPS)


def _first_overlaps(view: RolloutView, later: Indices, moves_mps: float) -> Overlaps:
    """Return each pair's first overlap; who overlaps as the rollout begins never counts."""
    centre, yaw = view.centre_m, view.states[..., 2]
    ego = centre[..., 0], centre[..., 1], yaw, view.speed_mps
    futures, _, users = view.there.shape
    found = np.empty((4, futures * users), dtype=np.intp)
    step_s = _step_s(view)
    count = compiled_pairs.find_overlaps(
        ego, view.users[:3], view.user_half_m, view.half_m, later, step_s, moves_mps, found
    )
    future, instant, user, steps = found[:, :count]
    base, at = view.states[future, instant, :3], instant + steps
    x, y = (values[future, at, user] for values in view.users[:2])
    heading_x, heading_y = (values[future, instant] for values in view.heading)
    axle_m = view.trailing_axle_m[future, instant]
    away_x = x - base[:, 0] - axle_m * heading_x
    away_y = y - base[:, 1] - axle_m * heading_y
    away = np.maximum(np.hypot(away_x, away_y), 1e-12)
    cos = (heading_x * away_x + heading_y * away_y) / away
    cos = np.where(view.backs[future, instant], -cos, cos)
    found_now = Overlaps(future, instant, user, steps, np.arccos(np.clip(cos, -1.0, 1.0)))
    begins = (instant == 0) & (steps == 0)
    return Overlaps._make(values[~begins] for values in found_now)


def _front_touches(view: RolloutView, at: Overlaps) -> Flags:
    """Return whether the line between the ego's leading corners touches the other's box (K,)."""
    there = at.future, at.instant, at.user
    seen = view.relative
    ahead, left, cos, sin = (v[there] for v in (seen.ahead_m, seen.left_m, seen.cos, seen.sin))
    half_length, half_width = (v[at.future, 0, at.user] for v in view.user_half_m)
    leading = np.where(view.backs[at.future, at.instant], -view.half_length_m, view.half_length_m)
    front, side = leading - ahead, view.half_width_m
    # The separating axes of a line across the ego and a box.
    off = np.abs(front) <= np.abs(cos) * half_length + np.abs(sin) * half_width
    off &= np.abs(left) <= side + np.abs(sin) * half_length + np.abs(cos) * half_width
    off &= np.abs(cos * front - sin * left) <= half_length + np.abs(sin) * side
    return np.asarray(off & (np.abs(sin * front + cos * left) <= half_width + np.abs(cos) * side))


def _astray(view: RolloutView, future: Indices, instant: Indices) -> Flags:
    """Return whether the ego is in several lanes, or a corner off the road, at (K,) instants."""
    astray = view.keep(staying).off[future, instant]
    if len(future):
        cos, sin = (values[future, instant] for values in view.heading)
        ahead = np.stack([cos, sin], axis=-1) * view.half_length_m
        left = np.stack([-sin, cos], axis=-1) * view.half_width_m
        centre = view.centre_m[future, instant]
        corners = [centre + a * ahead + b * left for a in (1, -1) for b in (1, -1)]
        astray = astray | _lanes(view).in_several(np.stack(corners, axis=1))
    return np.asarray(astray)


def _beside_path(view: RolloutView) -> Array:
    """Return how far (S, N) the ego's middle lies to the left of the path."""
    path, centre = _path(view), view.centre_m
    arc = path.locate(centre[:, 0]).arc_m
    offsets = np.empty(centre.shape[:2])
    for at in range(centre.shape[1]):
        place = path.locate(centre[:, at], near_arc_m=arc)
        arc, offsets[:, at] = place.arc_m, place.offset_m
    return offsets


def _zero_where(view: RolloutView, futures: Indices) -> Measure:
    kept = np.ones(len(view.valid))
    kept[futures] = 0.0
    return view.measure(kept)


def _step_s(view: RolloutView) -> float:
    return float(view.time_s[1] - view.time_s[0])


def _lanes(view: RolloutView) -> LaneAreas:
    if view.context.lanes is None:
        raise ValueError("lanes: no World given")
    return view.context.lanes


def _path(view: RolloutView) -> FrenetPath:
    if view.context.path is None:
        raise ValueError("lane keeping needs a path")
    return view.context.path
