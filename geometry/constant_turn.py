"""Where a car comes to that keeps its yaw rate and its speed, or its acceleration."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array

_STRAIGHT_RADPS = 1e-6


def constant_turn_rate(
    pose: Array,
    *,
    speed_mps: float,
    yaw_rate_radps: float,
    time_s: Array,
    accel_mps2: float = 0.0,
) -> Array:
    """Return (N, 3) poses at `time_s` (N,) from 0 on of a car at `pose` (3,) x, y, yaw.

    It keeps yaw rate and acceleration; who brakes stands once it has come to rest. Schubert,
    Richter, Wanielik (2008), Comparison and Evaluation of Advanced Motion Models: CTRV, and CTRA
    with an acceleration.
    """
    x, y, yaw = (float(value) for value in pose)
    if speed_mps * accel_mps2 < 0.0:
        time_s = np.minimum(time_s, -speed_mps / accel_mps2)
    heading = yaw + yaw_rate_radps * time_s
    if abs(yaw_rate_radps) < _STRAIGHT_RADPS:
        along = speed_mps * time_s + 0.5 * accel_mps2 * time_s**2
        return np.stack([x + along * np.cos(yaw), y + along * np.sin(yaw), heading], axis=1)
    radius = speed_mps / yaw_rate_radps
    # The same two terms that a growing radius adds to x and, a quarter turn on, to y.
    grown = accel_mps2 / yaw_rate_radps * time_s
    swung = accel_mps2 / yaw_rate_radps**2
    sines, cosines = np.sin(heading) - np.sin(yaw), np.cos(heading) - np.cos(yaw)
    return np.stack(
        [
            x + radius * sines + (grown * np.sin(heading) + swung * cosines),
            y - radius * cosines - (grown * np.cos(heading) - swung * sines),
            heading,
        ],
        axis=1,
    )
