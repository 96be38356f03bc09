"""How fast the nominal future is to be: as the driver goes on, or stands (`going_on.py`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import PATH_BEHIND_M, SPEED_AHEAD_STEP_S, PathAhead
from foretwin.geometry.frenet_path import SPACING_M, FrenetPath
from foretwin.geometry.polyline import arc_lengths
from foretwin.orchestrator.routing.going_on import (
    DRIVEN_S,
    FADING_S,
    USUAL_S,
    going_on_mps2,
    stands,
)
from foretwin.sim_worker.driver_model import COMFORT_DECEL_MPS2, CURVE_TIME_S

USUAL_BEND_MPS2, MOST_BEND_MPS2 = 2.25, 5.0
"""What drivers take across the way in bends: before they have shown that they take more, and at
most. Chosen on the drives given and to tune on (docs/trust.md)."""
_STEP_S = 0.1


class WaySpeeds(NamedTuple):
    """What a way says of speeds, every metre from the car on (M,): what its bends allow, its
    limits, infinite where unknown, and what was driven there before, NaN where nobody did.

    `bend_accel_mps2` is what the driver takes across the way in its bends.
    """

    bend_mps: Sequence[float]
    limit_mps: Sequence[float]
    driven_mps: Sequence[float]
    bend_accel_mps2: float


def bend_accel_mps2(curvature_pm: Array, speed_mps: float) -> float:
    """Return what the driver of a car takes across the way in bends, by how fast it is before them.

    `curvature_pm` (N,) is that of the way, `SPACING_M` apart from the car on. Who would have to
    brake harder than comfortably to take a bend as usual, takes it faster, or it is no such bend.
    """
    before_m = SPACING_M * np.arange(len(curvature_pm))
    square = np.maximum(speed_mps**2 - 2.0 * COMFORT_DECEL_MPS2 * before_m, 0.0)
    across = float((np.abs(curvature_pm) * square).max(initial=0.0))
    return min(max(across, USUAL_BEND_MPS2), MOST_BEND_MPS2)


def way_speeds(path: PathAhead, driven_mps: Array | None = None, *, speed_mps: float) -> WaySpeeds:
    """Return the speeds of a path that begins `PATH_BEHIND_M` behind the car.

    `driven_mps` (N,) is what was driven before at its points, NaN where nobody did; `speed_mps` is
    the car's.
    """
    line = FrenetPath(path.xy_m, path.speed_limit_mps)
    here = int((PATH_BEHIND_M - line.first_arc_m) / SPACING_M)
    across = bend_accel_mps2(line.curvature_pm[here:], speed_mps)
    bend_mps = line.speed_profile(lateral_accel_mps2=across, decel_mps2=COMFORT_DECEL_MPS2)
    driven = np.full(len(line.arc_m), math.nan)
    if driven_mps is not None:
        arc = arc_lengths(path.xy_m)
        near = np.clip(np.searchsorted(arc, line.arc_m), 0, len(arc) - 1)
        driven = np.where(line.arc_m <= arc[-1], driven_mps[near], math.nan)
    columns = (bend_mps, line.speed_limit_mps, driven)
    bends, limits, before = (column[here:].tolist() for column in columns)
    return WaySpeeds(bends, limits, before, across)


def speeds_ahead(
    way: WaySpeeds,
    *,
    speed_mps: float,
    acceleration_mps2: float,
    usual_share: float,
    horizon_s: float,
) -> Array:
    """Return (K,) speeds, `SPEED_AHEAD_STEP_S` apart from now until the horizon.

    `usual_share` of its limits is what the driver usually drives.
    """
    every = round(SPEED_AHEAD_STEP_S / _STEP_S)
    steps = math.ceil(horizon_s / SPEED_AHEAD_STEP_S - 1e-9) * every
    if stands(speed_mps, acceleration_mps2):
        at_s = _STEP_S * np.arange(0, steps + 1, every)
        return np.asarray(np.maximum(speed_mps - COMFORT_DECEL_MPS2 * at_s, 0.0))
    last = len(way.bend_mps) - 1
    most_mps = max(speed_mps, way.limit_mps[0])
    speeds, gone_m = [max(speed_mps, 0.0)], 0.0
    for step in range(steps):
        speed, here = speeds[-1], min(int(gone_m), last)
        wanted_mps, within_s = usual_share * way.limit_mps[here], USUAL_S
        if math.isfinite(way.driven_mps[here]):
            wanted_mps, within_s = way.driven_mps[here], DRIVEN_S
        accel = going_on_mps2(
            speed,
            acceleration_mps2,
            math.exp(-(step + 0.5) * _STEP_S / FADING_S),
            wanted_mps=wanted_mps,
            within_s=within_s,
            bend_mps=way.bend_mps[min(int(gone_m + CURVE_TIME_S * speed), last)],
        )
        faster = min(max(speed + _STEP_S * accel, 0.0), most_mps)
        gone_m += _STEP_S * (speed + faster) / 2.0
        speeds.append(faster)
    return np.array(speeds[::every])
