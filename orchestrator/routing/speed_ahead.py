"""How fast the nominal future is to be: first what the driver does now, then what is usual.

Law: the present acceleration fades by 1/e in `FADING_S`, and as it fades the speed is drawn towards
the driver's usual one (their share of the limit there), with a time constant of `USUAL_S`. Bends
ahead are braked for as the planners brake for them. A car that stands and does not pull away goes
on standing. The form is the linear prediction with damped trend of Gardner and McKenzie (1985),
"Forecasting trends in time series".

Both times were chosen on drives through Chemnitz and Boulder, on which the law's mean error along
the way is 3 % less than that of one that aims at a speed 2 s ahead, and measured on others
(docs/trust.md).
"""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import PATH_BEHIND_M, SPEED_AHEAD_STEP_S, PathAhead
from foretwin.geometry.frenet_path import SPACING_M, FrenetPath
from foretwin.geometry.polyline import arc_lengths
from foretwin.sim_worker.driver_model import (
    COMFORT_DECEL_MPS2,
    CURVE_TIME_S,
    LATERAL_ACCEL_MPS2,
    MAX_DECEL_MPS2,
    STANDING_MPS,
)

FADING_S = 3.0
USUAL_S = 24.0
DRIVEN_S = 5.0
"""Time constant towards what was driven there before: on roads of Chemnitz that came again the mean
error along the way is 9 % less up to 8 s, 4 % up to 4 s, and up to 1 and 2 s about the same."""
PULLING_AWAY_MPS2 = 0.15
"""A car that stands and accelerates less does not pull away."""
_STEP_S = 0.1


def speeds_ahead(
    path: PathAhead,
    *,
    speed_mps: float,
    acceleration_mps2: float,
    usual_share: float,
    horizon_s: float,
    driven_mps: Array | None = None,
) -> Array:
    """Return (K,) speeds, `SPEED_AHEAD_STEP_S` apart from now until the horizon.

    The path begins `PATH_BEHIND_M` behind the car; `usual_share` of its limits is what the driver
    usually drives. `driven_mps` (N,) is what was driven before at its points, NaN where nobody did.
    """
    line = FrenetPath(path.xy_m, path.speed_limit_mps)
    curve = _curve_speeds(line).tolist()
    limit = line.speed_limit_mps.tolist()
    driven = [math.nan] * len(limit)
    if driven_mps is not None:
        arc = arc_lengths(path.xy_m)
        near = np.clip(np.searchsorted(arc, line.arc_m), 0, len(arc) - 1)
        driven = np.where(line.arc_m <= arc[-1], driven_mps[near], np.nan).tolist()
    most_mps = max(speed_mps, limit[_node(line, PATH_BEHIND_M)])
    every = round(SPEED_AHEAD_STEP_S / _STEP_S)
    steps = math.ceil(horizon_s / SPEED_AHEAD_STEP_S - 1e-9) * every
    speeds = [max(speed_mps, 0.0)]
    if stands(speed_mps, acceleration_mps2):
        at_s = _STEP_S * np.arange(0, steps + 1, every)
        return np.asarray(np.maximum(speed_mps - COMFORT_DECEL_MPS2 * at_s, 0.0))
    arc_m = PATH_BEHIND_M
    for step in range(steps):
        speed = speeds[-1]
        present = math.exp(-(step + 0.5) * _STEP_S / FADING_S)
        accel = acceleration_mps2 * present
        node = _node(line, arc_m)
        wanted_mps, within_s = usual_share * limit[node], USUAL_S
        if math.isfinite(driven[node]):
            wanted_mps, within_s = driven[node], DRIVEN_S
        if math.isfinite(wanted_mps):
            accel += (1.0 - present) * (wanted_mps - speed) / within_s
        bend_mps = curve[_node(line, arc_m + CURVE_TIME_S * speed)]
        accel = max(min(accel, (bend_mps - speed) / CURVE_TIME_S), -MAX_DECEL_MPS2)
        faster = min(max(speed + _STEP_S * accel, 0.0), most_mps)
        arc_m += _STEP_S * (speed + faster) / 2.0
        speeds.append(faster)
    return np.array(speeds[::every])


def stands(speed_mps: float, acceleration_mps2: float) -> bool:
    """Return whether a car stands and does not pull away."""
    return speed_mps < STANDING_MPS and acceleration_mps2 < PULLING_AWAY_MPS2


def bend_speeds(path: PathAhead) -> tuple[float, ...]:
    """Return what the bends of a path allow, every metre from the car on."""
    line = FrenetPath(path.xy_m)
    return tuple(_curve_speeds(line)[_node(line, PATH_BEHIND_M) :].tolist())


def _curve_speeds(line: FrenetPath) -> Array:
    return line.speed_profile(lateral_accel_mps2=LATERAL_ACCEL_MPS2, decel_mps2=COMFORT_DECEL_MPS2)


def _node(line: FrenetPath, arc_m: float) -> int:
    return min(int((arc_m - line.first_arc_m) / SPACING_M), len(line.arc_m) - 1)
