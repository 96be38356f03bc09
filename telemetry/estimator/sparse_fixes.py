"""Speed, course and bend from fixes that come once a second, where nothing else tells of them.

Wheels tell of the speed alone: how a car turns it is left to its fixes.

A filter that predicts a second ahead leads a bending car far from where its linearisation holds:
it swings about the truth. The quadratic through the last three fixes needs no prediction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.estimator.filter_state import ACCEL, SPEED, YAW
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.position_gate import LocalFix

_SPARSE_S, _LONGEST_S = 0.4, 3.0
"""Fixes are sparse from the first on; between some that lie farther apart much may happen."""
_LOOKED_AT = 4
"""So many must be apart: where one of many is held back, the receiver is not slow. Chosen."""
_JERK_MPS3 = 1.5
"""Of a car in a town, along and across (Bae, Moon, Seo 2019, table 1: 0.9 to 2.0). Rounded."""
_HARD_MPS2 = 4.0
"""A hard turn or stop of a driver in traffic. Chosen."""
_MOVING_MPS = 1.0
"""Whoever is slower has no course that fixes would tell."""
_LOST_RAD = 0.35
"""A heading less sure than this at the next fix is none that a prediction may rest on. Chosen."""
_SHOWN_BY = 2.0
"""So many times as sure as the filter of its heading must the course of a way be. Chosen: with
1, 1.5, 3 and 5 a car that turns between fixes of 2.1 m is farther off."""
_SHORTEST_CHORD = 0.5
"""Of the way driven, where it bends as hard as a car can turn between two fixes. Chosen."""


class _MotionShown(NamedTuple):
    """Velocity and acceleration (2,) at the newest fix, and their standard deviations."""

    velocity_mps: Array
    accel_mps2: Array
    velocity_std_mps: float
    accel_std_mps2: float


def sparse(fixes: Sequence[LocalFix]) -> bool:
    """Return whether the latest fixes came so far apart that a filter cannot lead between them."""
    if len(fixes) < _LOOKED_AT:
        return False
    times = [fixes[-k].time_s for k in range(1, _LOOKED_AT + 1)]
    steps = [late - early for late, early in pairwise(times)]
    return min(steps) >= _SPARSE_S and max(steps) <= _LONGEST_S


def turned_m(fixes: Sequence[LocalFix]) -> float:
    """Return how far off sparse fixes may lie for a car that turned or braked since the last."""
    if not sparse(fixes):
        return 0.0
    step_s = fixes[-1].time_s - fixes[-2].time_s
    return 0.5 * _HARD_MPS2 * step_s * step_s


def _shown(fixes: Sequence[LocalFix], std_m: float) -> _MotionShown:
    """Return what the latest three fixes, good to `std_m`, show of the motion, or the latest two.

    The quadratic's derivatives at its end err by a third of the jerk times the step squared, and
    by the jerk times the step (Taylor); a chord's by how hard one may turn meanwhile.
    """
    middle, last = fixes[-2], fixes[-1]
    after_s = last.time_s - middle.time_s
    slope = (last.xy_m - middle.xy_m) / after_s
    if len(fixes) < 3 or middle.time_s - fixes[-3].time_s > _LONGEST_S:
        off_mps = math.hypot(1.5 * std_m / after_s, 0.5 * after_s * _HARD_MPS2)
        return _MotionShown(slope, np.zeros(2), off_mps, _HARD_MPS2)
    first = fixes[-3]
    before_s = middle.time_s - first.time_s
    slope_before = (middle.xy_m - first.xy_m) / before_s
    accel = 2.0 * (slope - slope_before) / (before_s + after_s)
    velocity = slope + 0.5 * after_s * accel
    step_s = 0.5 * (before_s + after_s)
    velocity_std = math.hypot(2.5 * std_m / step_s, _JERK_MPS3 * step_s * step_s / 3.0)
    accel_std = math.hypot(2.5 * std_m / step_s**2, _JERK_MPS3 * step_s)
    return _MotionShown(velocity, accel, velocity_std, accel_std)


def _bend_pm(way: Array, accel_mps2: Array, speed_mps: float) -> float:
    """Return the curvature of who accelerates so while heading along `way` (2,)."""
    return float(way[0] * accel_mps2[1] - way[1] * accel_mps2[0]) / speed_mps**2


def _bearing_lost(filter_: KinematicFilter, fixes: Sequence[LocalFix], std_m: float) -> bool:
    """Whether a filter that knows its speed no longer knows its heading at the newest fix, good to
    `std_m`, which lies as far from the one before as the car has driven."""
    yaw_std_rad = math.sqrt(filter_.covariance.item(YAW, YAW))
    if len(fixes) < 2 or yaw_std_rad < _LOST_RAD:
        return False
    step_s = fixes[-1].time_s - fixes[-2].time_s
    if not _SPARSE_S <= step_s <= _LONGEST_S:
        return False
    moved_m = math.dist(fixes[-1].xy_m, fixes[-2].xy_m)
    way_m, slack_m = abs(filter_.mean.item(SPEED)) * step_s, 0.5 * _HARD_MPS2 * step_s**2
    driven = _SHORTEST_CHORD * way_m - slack_m < moved_m < way_m + slack_m + 4.0 * std_m
    # A way's course is as good as its ends are beside its length.
    least_m = max(_SHOWN_BY * math.sqrt(2.0) * std_m / yaw_std_rad, _MOVING_MPS * step_s)
    return driven and min(moved_m, way_m) > least_m


def bear_anew(
    filter_: KinematicFilter,
    fixes: Sequence[LocalFix],
    std_m: float,
    white_m: float,
    lever_m: tuple[float, float],
) -> bool:
    """Put a car that has lost its heading where the newest fix is, facing as the latest ones show.

    They are good to `std_m`, and to `white_m` each by itself. Returns whether it had lost it; what
    is known of its speed stays.
    """
    if not _bearing_lost(filter_, fixes, white_m):
        return False
    shown = _shown(fixes, white_m)
    speed = max(float(np.hypot(*shown.velocity_mps)), _MOVING_MPS)
    way = shown.velocity_mps / math.copysign(speed, filter_.mean.item(SPEED))
    filter_.turn_anew(
        math.atan2(way[1], way[0]),
        shown.velocity_std_mps / speed,
        _bend_pm(way, shown.accel_mps2, speed),
        shown.accel_std_mps2 / speed**2,
    )
    filter_.move_position(fixes[-1].xy_m, std_m, lever_m)
    return True


def follow_fixes(
    filter_: KinematicFilter,
    fixes: Sequence[LocalFix],
    std_m: float,
    *,
    turning: bool,
    pace: bool = True,
) -> None:
    """Correct the motion by what the latest three of sparse fixes, good to `std_m`, show of it.

    `turning` where nothing else tells of it, `pace` where nothing else tells of that.
    """
    velocity, accel, velocity_std, accel_std = _shown(fixes, std_m)
    speed = float(np.hypot(*velocity))
    if not pace and abs(filter_.mean.item(SPEED)) < max(_MOVING_MPS, 2.0 * velocity_std):
        return  # the curve through fixes of a car that stops leads back
    ahead = np.array([math.cos(filter_.mean[YAW]), math.sin(filter_.mean[YAW])])
    if turning and speed > max(_MOVING_MPS, 2.0 * velocity_std):
        way = velocity / speed
        if filter_.may_reverse and float(way @ ahead) < 0.0:
            way, speed = -way, -speed
        filter_.correct_yaw(math.atan2(way[1], way[0]), velocity_std / abs(speed))
        filter_.correct_curvature(_bend_pm(way, accel, speed), accel_std / speed**2)
        ahead = way
    if not pace:
        return
    row = np.zeros(len(filter_.mean))
    row[SPEED] = 1.0
    filter_.correct(row, float(velocity @ ahead) - filter_.mean[SPEED], velocity_std)
    row[SPEED], row[ACCEL] = 0.0, 1.0
    filter_.correct(row, float(accel @ ahead) - filter_.mean[ACCEL], accel_std)
