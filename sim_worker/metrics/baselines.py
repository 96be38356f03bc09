"""Predictions that need no simulation: what a future must beat to be worth its cost."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array

_STRAIGHT_RADPS = 1e-6


def constant_velocity(pose: Array, *, speed_mps: float, time_s: Array) -> Array:
    """Return (N, 3) poses at `time_s` (N,) of a car that goes straight on from `pose` (3,)."""
    return constant_turn_rate(pose, speed_mps=speed_mps, yaw_rate_radps=0.0, time_s=time_s)


def constant_turn_rate(
    pose: Array, *, speed_mps: float, yaw_rate_radps: float, time_s: Array
) -> Array:
    """Return (N, 3) poses at `time_s` (N,) of a car that keeps its speed and yaw rate.

    Schubert, Richter, Wanielik (2008), Comparison and Evaluation of Advanced Motion Models, CTRV.
    """
    x, y, yaw = (float(value) for value in pose)
    heading = yaw + yaw_rate_radps * time_s
    if abs(yaw_rate_radps) < _STRAIGHT_RADPS:
        along = speed_mps * time_s
        return np.stack([x + along * np.cos(yaw), y + along * np.sin(yaw), heading], axis=1)
    radius = speed_mps / yaw_rate_radps
    return np.stack(
        [
            x + radius * (np.sin(heading) - np.sin(yaw)),
            y - radius * (np.cos(heading) - np.cos(yaw)),
            heading,
        ],
        axis=1,
    )
