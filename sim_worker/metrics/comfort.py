"""Comfort: accelerations, jerk and turning of the ego, with nuPlan's bounds."""

from __future__ import annotations

import functools
import math
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView

BOUNDS = MappingProxyType(
    {
        "lon_accel_mps2": (-4.05, 2.40),
        "lat_accel_mps2": (-4.89, 4.89),
        "jerk_mps3": (-8.37, 8.37),
        "lon_jerk_mps3": (-4.13, 4.13),
        "yaw_rate_radps": (-0.95, 0.95),
        "yaw_accel_radps2": (-1.93, 1.93),
    }
)
"""nuPlan devkit, planning/metrics, ego_is_comfortable (Caesar et al., 2021, nuPlan: A closed-loop
ML-based planning benchmark): the extremes of its human drivers. The same in NAVSIM."""
ACCEL_WINDOW_S = 0.8
_JERK_WINDOW_S = 1.4
_ORDER = 2
"""Smoothing as there: quadratics over 8 samples of 0.1 s for accelerations, 15 for derivatives."""


class EgoMotion(NamedTuple):
    """How base_link moves, all (S, N), smoothed; jerk is the rate of the acceleration's size."""

    lon_accel_mps2: Array
    lat_accel_mps2: Array
    jerk_mps3: Array
    lon_jerk_mps3: Array
    yaw_rate_radps: Array
    yaw_accel_radps2: Array


def motion(view: RolloutView) -> EgoMotion:
    """Return the motion of the ego by Savitzky and Golay (1964), Smoothing and Differentiation.

    Accelerations follow from the velocities in the states, so that planned motion is judged like
    simulated: a_lon = dvx/dt - vy ω, a_lat = dvy/dt + vx ω. Raises ValueError where the instants
    are not evenly spaced.
    """
    steps = np.diff(view.time_s)
    if np.ptp(steps) > 1e-3 * steps[0]:
        raise ValueError("comfort needs evenly spaced instants")
    vx, vy = view.driven[..., 3], view.driven[..., 4]
    yaw = np.unwrap(view.driven[..., 2], axis=1)
    count, step_s = len(view.time_s), float(steps.mean())
    slope = _operator(count, step_s, ACCEL_WINDOW_S, 1)
    rate = _operator(count, step_s, _JERK_WINDOW_S, 1)
    curve = _operator(count, step_s, _JERK_WINDOW_S, 2)
    turning = yaw @ rate
    lon = vx @ slope - vy * turning
    lat = vy @ slope + vx * turning
    found = EgoMotion(
        lon_accel_mps2=lon,
        lat_accel_mps2=lat,
        jerk_mps3=np.hypot(lon, lat) @ rate,
        lon_jerk_mps3=lon @ rate,
        yaw_rate_radps=turning,
        yaw_accel_radps2=yaw @ curve,
    )
    counts = view.counts
    if counts is None:
        return found
    # What comes after the end of a future is no extreme of it.
    return EgoMotion._make(np.where(counts, values, values[:, :1]) for values in found)


class Scatter(NamedTuple):
    """How far samples of speed and yaw lie beside the quadratics that smooth them, (S, N)."""

    speed_mps: Array
    yaw_rad: Array


def scatter(view: RolloutView) -> Scatter:
    """Return the scatter of a motion about itself: standard deviations over the window of the
    accelerations, whose quadratics use up three of its samples."""
    step_s = float(np.diff(view.time_s).mean())
    count = len(view.time_s)
    smooth = _operator(count, step_s, ACCEL_WINDOW_S, 0)
    window = np.abs(np.arange(count)[:, None] - np.arange(count)) * step_s <= ACCEL_WINDOW_S / 2
    free = np.maximum(window.sum(axis=0) - _ORDER - 1, 1)
    sides = view.driven[..., 3], np.unwrap(view.driven[..., 2], axis=1)
    return Scatter(*(np.sqrt(np.square(x - x @ smooth) @ window / free) for x in sides))


def motion_std(
    view: RolloutView, speed_std_mps: Array, yaw_std_rad: Array, *, alike_s: float
) -> EgoMotion:
    """Return how uncertain `motion` is (S, N) where speed and yaw are: their standard deviations,
    (N,) or (S, N).

    Errors stay alike for `alike_s` and are then others: through the same sums as the values, by
    first order. What slips sideways is left out.
    """
    step_s = float(np.diff(view.time_s).mean())
    longer = max(1.0, alike_s / step_s)
    through = _squares(len(view.time_s), step_s)
    speed, yaw = longer * np.square(speed_std_mps), longer * np.square(yaw_std_rad)
    vx = np.square(view.driven[..., 3])
    turning = np.square(view.keep(motion).yaw_rate_radps)
    lon_jerk = speed @ through.slope_rate
    lat_jerk = vx * (yaw @ through.rate_rate) + turning * (speed @ through.rate)
    variances = EgoMotion(
        lon_accel_mps2=speed @ through.slope,
        lat_accel_mps2=vx * (yaw @ through.rate) + turning * speed,
        jerk_mps3=lon_jerk + lat_jerk,
        lon_jerk_mps3=lon_jerk,
        yaw_rate_radps=yaw @ through.rate,
        yaw_accel_radps2=yaw @ through.curve,
    )
    return EgoMotion._make(np.broadcast_to(np.sqrt(one), vx.shape) for one in variances)


class _Squares(NamedTuple):
    """What a row of N variances is multiplied with, each (N, N), for those of its derivatives."""

    slope: Array
    rate: Array
    curve: Array
    slope_rate: Array
    rate_rate: Array


@functools.lru_cache(maxsize=32)
def _squares(count: int, step_s: float) -> _Squares:
    slope = _operator(count, step_s, ACCEL_WINDOW_S, 1)
    rate = _operator(count, step_s, _JERK_WINDOW_S, 1)
    curve = _operator(count, step_s, _JERK_WINDOW_S, 2)
    return _Squares(*(np.square(one) for one in (slope, rate, curve, slope @ rate, rate @ rate)))


@functools.lru_cache(maxsize=32)
def _operator(count: int, step_s: float, window_s: float, derivative: int) -> Array:
    """Return (N, N) what a row of N samples is multiplied with for its smoothed derivative."""
    window = min(2 * round(window_s / step_s / 2.0) + 1, count - (count + 1) % 2)
    order = min(max(_ORDER, derivative), window - 1)
    if order < derivative:
        return np.zeros((count, count))
    # In numpy, since scipy.signal takes a worker over a second to import.
    half = window // 2
    samples = np.arange(-half, half + 1)
    polynomials = np.linalg.pinv(np.vander(samples, order + 1, increasing=True).astype(np.float64))
    centre = np.clip(np.arange(count), half, count - 1 - half)
    at = (np.arange(count) - centre).astype(np.float64)
    operator: Array = np.zeros((count, count))
    for power in range(derivative, order + 1):
        slope = math.perm(power, derivative) * at ** (power - derivative)
        operator[centre[:, None] + samples, np.arange(count)[:, None]] += (
            slope[:, None] * polynomials[power]
        )
    operator /= step_s**derivative
    operator.flags.writeable = False
    return operator


def max_acceleration(view: RolloutView) -> Measure:
    """Greatest acceleration along the road (S,)."""
    return view.measure(view.keep(motion).lon_accel_mps2.max(axis=1))


def max_deceleration(view: RolloutView) -> Measure:
    """Greatest deceleration along the road (S,), positive where it brakes at all."""
    return view.measure(-view.keep(motion).lon_accel_mps2.min(axis=1))


def max_lateral_acceleration(view: RolloutView) -> Measure:
    """Greatest lateral acceleration (S,) to either side."""
    return view.measure(np.abs(view.keep(motion).lat_accel_mps2).max(axis=1))


def max_jerk(view: RolloutView) -> Measure:
    """Greatest rate of change of the acceleration's size (S,)."""
    return view.measure(np.abs(view.keep(motion).jerk_mps3).max(axis=1))


def max_longitudinal_jerk(view: RolloutView) -> Measure:
    """Greatest rate of change of the acceleration along the road (S,)."""
    return view.measure(np.abs(view.keep(motion).lon_jerk_mps3).max(axis=1))


def max_yaw_rate(view: RolloutView) -> Measure:
    """Greatest yaw rate (S,) to either side."""
    return view.measure(np.abs(view.keep(motion).yaw_rate_radps).max(axis=1))


def max_yaw_acceleration(view: RolloutView) -> Measure:
    """Greatest yaw acceleration (S,) to either side."""
    return view.measure(np.abs(view.keep(motion).yaw_accel_radps2).max(axis=1))


def comfortable(view: RolloutView) -> Measure:
    """Whether all of `BOUNDS` are kept at all instants (S,): 1 or 0."""
    found = view.keep(motion)._asdict()
    kept: Flags = np.ones(len(view.valid), dtype=bool)
    for name, (least, most) in BOUNDS.items():
        kept &= ((found[name] >= least) & (found[name] <= most)).all(axis=1)
    return view.measure(kept.astype(np.float64))
