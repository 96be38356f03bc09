"""What positions of a car that hardly moves may do to it: nothing that a car cannot do."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.steering import MAX_CURVATURE_PM
from foretwin.telemetry.estimator.filter_state import YAW
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter

_DRIFT_M = 0.03
_LEAST_TURN_RAD = 0.002
_KNOWN_YAW_VAR = 0.15**2


def drift_sideways(
    filter_: KinematicFilter, xy_m: Array, std_m: float, lever_m: tuple[float, float]
) -> bool:
    """Take a step across the car as the receiver's own: a car that creeps cannot go there.

    Returns whether there was one.
    """
    cos, sin = math.cos(filter_.mean[YAW]), math.sin(filter_.mean[YAW])
    step = xy_m - filter_.sensor_xy(lever_m)
    along, across = cos * step[0] + sin * step[1], -sin * step[0] + cos * step[1]
    if abs(across) <= max(abs(along), _DRIFT_M) or filter_.covariance[YAW, YAW] >= _KNOWN_YAW_VAR:
        return False
    sideways: Array = across * np.array([-sin, cos])
    filter_.move_position(filter_.sensor_xy(lever_m) + sideways, std_m, lever_m)
    return True


def limit_turn(filter_: KinematicFilter, yaw_before_rad: float, *, moved_m: float) -> None:
    """Undo what a correction turned beyond the tightest bend over `moved_m`.

    Positions that shift under a car that hardly moves must not turn it round.
    """
    if filter_.covariance[YAW, YAW] > _KNOWN_YAW_VAR:
        return
    reach = MAX_CURVATURE_PM * moved_m + _LEAST_TURN_RAD
    change = math.remainder(filter_.mean[YAW] - yaw_before_rad, math.tau)
    filter_.mean[YAW] = yaw_before_rad + min(max(change, -reach), reach)
