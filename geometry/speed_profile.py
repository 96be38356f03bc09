"""Speeds along a path: what bends allow, and what brakes and drive make of it."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array

_STRAIGHT_PM = 1e-6


def speed_in_bends_mps(curvature_pm: Array, lateral_accel_mps2: float) -> Array:
    """Return √(a_lat / |κ|) for curvatures of any shape; fast, yet finite, where there is none."""
    return np.asarray(np.sqrt(lateral_accel_mps2 / np.maximum(np.abs(curvature_pm), _STRAIGHT_PM)))


def braked(speed_mps: Array, xy_m: Array, decel_mps2: float) -> Array:
    """Lower speeds (N,) at points (N, 2) so that `decel_mps2` suffices to reach each next one.

    v² ≤ v₁² + 2 a Δs, from the end to the beginning: one pass of the usual two-pass profile.
    """
    result = speed_mps.copy()
    step_m = np.hypot(*np.diff(xy_m, axis=0).T)
    for i in range(len(result) - 2, -1, -1):
        result[i] = min(result[i], math.sqrt(result[i + 1] ** 2 + 2.0 * decel_mps2 * step_m[i]))
    return result


def accelerated(speed_mps: Array, xy_m: Array, accel_mps2: float) -> Array:
    """Lower speeds (N,) at points (N, 2) to what `accel_mps2` reaches from each one before."""
    return braked(speed_mps[::-1], xy_m[::-1], accel_mps2)[::-1]
