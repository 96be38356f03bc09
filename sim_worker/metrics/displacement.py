"""Displacement of a prediction from what happened, and how many futures really differ."""

from __future__ import annotations

import numpy as np

from contracts.arrays import Array
from contracts.frames import wrap_angle
from contracts.simulation import HorizonError


def horizon_error(predicted: Array, actual: Array) -> HorizonError:
    """Compare (N, 3) x, y, yaw at the same N instants of one frame, the seeding one left out.

    ADE is the mean, FDE the final distance; lateral, longitudinal and heading are those of the
    last instant, signed, in the actual pose's axes. Raises ValueError for empty or unequal input.
    """
    if predicted.shape != actual.shape or predicted.ndim != 2 or predicted.shape[1] != 3:
        raise ValueError(f"poses of shape {predicted.shape} against {actual.shape}: need (N, 3)")
    if len(predicted) == 0:
        raise ValueError("no instant to compare")
    difference = predicted[:, :2] - actual[:, :2]
    distance = np.hypot(difference[:, 0], difference[:, 1])
    yaw = float(actual[-1, 2])
    cos, sin = np.cos(yaw), np.sin(yaw)
    dx, dy = difference[-1]
    return HorizonError(
        ade_m=float(distance.mean()),
        fde_m=float(distance[-1]),
        lateral_m=float(cos * dy - sin * dx),
        longitudinal_m=float(cos * dx + sin * dy),
        heading_rad=float(wrap_angle(predicted[-1, 2] - yaw)),
    )


def distinct_count(ends: Array, least_m: float = 0.1) -> int:
    """Return how many of the (S, 2) end points lie more than `least_m` from all counted before."""
    kept = np.empty((0, 2))
    for end in np.asarray(ends, dtype=np.float64):
        apart = np.hypot(kept[:, 0] - end[0], kept[:, 1] - end[1])
        if np.isfinite(end).all() and (apart > least_m).all():
            kept = np.vstack([kept, end])
    return len(kept)
