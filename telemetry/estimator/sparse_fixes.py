"""Speed, course and bend from fixes that come once a second, where nothing else tells of them.

A filter that predicts a second ahead leads a bending car far from where its linearisation holds:
it swings about the truth. The quadratic through the last three fixes needs no prediction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

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


def follow_fixes(
    filter_: KinematicFilter,
    fixes: Sequence[LocalFix],
    std_m: float,
    *,
    turning: bool,
    going: bool = True,
) -> None:
    """Correct the motion by what the latest three of sparse fixes, good to `std_m`, show of it.

    `turning` where nothing else tells of it, `going` where nothing does of the speed.

    The quadratic's derivatives at its end err by a third of the jerk times the step squared, and
    by the jerk times the step (Taylor).
    """
    first, middle, last = fixes[-3], fixes[-2], fixes[-1]
    before_s, after_s = middle.time_s - first.time_s, last.time_s - middle.time_s
    slope_before = (middle.xy_m - first.xy_m) / before_s
    slope = (last.xy_m - middle.xy_m) / after_s
    accel = 2.0 * (slope - slope_before) / (before_s + after_s)
    velocity = slope + 0.5 * after_s * accel
    step_s = 0.5 * (before_s + after_s)
    velocity_std = math.hypot(2.5 * std_m / step_s, _JERK_MPS3 * step_s * step_s / 3.0)
    accel_std = math.hypot(2.5 * std_m / step_s**2, _JERK_MPS3 * step_s)
    speed = float(np.hypot(*velocity))
    ahead = np.array([math.cos(filter_.mean[YAW]), math.sin(filter_.mean[YAW])])
    if turning and speed > max(_MOVING_MPS, 2.0 * velocity_std):
        way = velocity / speed
        if filter_.may_reverse and float(way @ ahead) < 0.0:
            way, speed = -way, -speed
        filter_.correct_yaw(math.atan2(way[1], way[0]), velocity_std / abs(speed))
        bend = float(way[0] * accel[1] - way[1] * accel[0]) / speed**2
        filter_.correct_curvature(bend, accel_std / speed**2)
        ahead = way
    if not going:
        return
    row = np.zeros(len(filter_.mean))
    row[SPEED] = 1.0
    filter_.correct(row, float(velocity @ ahead) - filter_.mean[SPEED], velocity_std)
    row[SPEED], row[ACCEL] = 0.0, 1.0
    filter_.correct(row, float(accel @ ahead) - filter_.mean[ACCEL], accel_std)
