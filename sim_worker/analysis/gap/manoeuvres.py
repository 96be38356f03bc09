"""What the vehicle is doing, from its measured motion alone."""

from __future__ import annotations

from typing import get_args

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.gap import Manoeuvre

MANOEUVRES: tuple[Manoeuvre, ...] = get_args(Manoeuvre)
_STANDS_MPS = 0.3
_BRAKES_MPS2, _ACCELERATES_MPS2 = -0.7, 0.7
_CURVE_RADPS, _CURVE_PM = 0.06, 0.01


def manoeuvre_of(
    *, speed_mps: Array | float, yaw_rate_radps: Array | float, accel_mps2: Array | float
) -> Manoeuvre:
    """Name what a stretch of motion is, from its mean speed, yaw rate and acceleration.

    Standing counts first, then the change of speed, then the bend: a car that brakes in a bend
    is braking.
    """
    speed = float(np.mean(np.abs(speed_mps)))
    rate, accel = float(np.mean(yaw_rate_radps)), float(np.mean(accel_mps2))
    if speed < _STANDS_MPS:
        return "standstill"
    if accel < _BRAKES_MPS2:
        return "braking"
    if accel > _ACCELERATES_MPS2:
        return "accelerating"
    if abs(rate) > _CURVE_RADPS or abs(rate) / max(speed, 1.0) > _CURVE_PM:
        return "curve"
    return "straight"
