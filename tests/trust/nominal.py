"""How far the nominal future is from where the car then was, beside simpler forecasts.

    python -m tests.trust.nominal [NAME ...] [--group given|tuned_on|held_out]

prints for each pass the mean distance in metres over all instants up to 1, 2, 4 and 8 s, and over
all rounds, standing ones too. `before` is the nominal future as it was without speeds ahead and
without the car's own heading, by the same planner; `known path` is no rival: a point that follows
the path which was then driven, at the speed that `before` aims at.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import local_from_geo, local_from_geo_yaw
from foretwin.contracts.futures import Job
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import (
    ACCEL_EXPONENT,
    COMFORT_DECEL_MPS2,
    LATERAL_ACCEL_MPS2,
    MAX_ACCEL_MPS2,
)
from tests.orchestrator.in_process_drive import Round
from tests.trust.nominal_passes import TIMES_S, Pass, asked_passes

UP_TO_S = (1.0, 2.0, 4.0, 8.0)
_STEP_S = 0.1
_LEAST_STEP_M = 0.8


def _start(one: Round) -> tuple[Array, Array]:
    position, frame = one.state.position, one.world.frame
    lat, lon = position.lat_deg, position.lon_deg
    yaw = float(local_from_geo_yaw(frame, one.state.yaw_rad, lat, lon))
    return np.asarray(local_from_geo(frame, lat, lon)), np.array([np.cos(yaw), np.sin(yaw)])


def constant_velocity(_: Pass, one: Round) -> Array:
    """Straight on at the present speed."""
    xy, ahead = _start(one)
    return np.asarray(xy + one.state.speed_mps * TIMES_S[:, None] * ahead)


def constant_acceleration(_: Pass, one: Round) -> Array:
    """Straight on, the speed's trend of the last second going on until the car stands."""
    xy, ahead = _start(one)
    speed, accel = one.state.speed_mps, one.acceleration_mps2
    until = np.minimum(TIMES_S, speed / -accel) if accel < 0.0 else TIMES_S
    return np.asarray(xy + (speed * until + 0.5 * accel * until**2)[:, None] * ahead)


def constant_turn_rate(_: Pass, one: Round) -> Array:
    """On the present circle at the present speed."""
    xy, (cos, sin) = _start(one)
    turned = one.state.yaw_rate_radps * (TIMES_S - _STEP_S / 2.0)
    step = _STEP_S * one.state.speed_mps
    ways = np.column_stack(
        [cos * np.cos(turned) - sin * np.sin(turned), sin * np.cos(turned) + cos * np.sin(turned)]
    )
    return np.asarray(xy + np.cumsum(step * ways, axis=0))


def nominal(on: Pass, one: Round) -> Array:
    """What is shipped."""
    return _played(on, one, one.job)


def before(on: Pass, one: Round) -> Array:
    """The same without speeds ahead, on the path as the map has it."""
    old = msgspec.structs.replace(one.job, path=one.intent.path, speed_ahead_mps=msgspec.UNSET)
    return _played(on, one, old)


def known_path(on: Pass, one: Round) -> Array:
    """The planner's laws as they were, of a point on the path that the car then took."""
    way = on.true_xy_m(one, np.arange(-2.0, 40.0, _STEP_S))
    kept = [way[0]]
    for xy in way[1:]:
        if np.hypot(*(xy - kept[-1])) >= _LEAST_STEP_M:
            kept.append(xy)
    xy, _ = _start(one)
    if len(kept) < 3:
        return np.repeat(xy[None], len(TIMES_S), axis=0)
    path = FrenetPath(np.array(kept))
    begin = path.locate(xy[None], upto_arc_m=80.0)
    curve = path.speed_profile(lateral_accel_mps2=LATERAL_ACCEL_MPS2, decel_mps2=COMFORT_DECEL_MPS2)
    speed, aim, arc = max(one.state.speed_mps, 0.0), one.intent.cruise_speed_mps, begin.arc_m[0]
    arcs = []
    for _ in TIMES_S:
        ratio = speed / max(aim, 0.1)
        if aim < 0.05:
            free = -COMFORT_DECEL_MPS2
        elif ratio <= 1.0:
            free = MAX_ACCEL_MPS2 * (1.0 - ratio**ACCEL_EXPONENT)
        else:
            power = -MAX_ACCEL_MPS2 * ACCEL_EXPONENT / COMFORT_DECEL_MPS2
            free = -COMFORT_DECEL_MPS2 * (1.0 - ratio**power)
        bend = (path.at_nodes(curve, np.array([arc + 0.5 * speed]))[0] - speed) / 0.5
        faster = max(0.0, speed + _STEP_S * min(free, bend))
        arc += _STEP_S * (speed + faster) / 2.0
        speed = faster
        arcs.append(arc)
    return path.point_at(np.array(arcs), begin.offset_m[0])


FORECASTS: dict[str, Callable[[Pass, Round], Array]] = {
    "nominal": nominal,
    "before": before,
    "constant velocity": constant_velocity,
    "constant acceleration": constant_acceleration,
    "constant turn rate": constant_turn_rate,
    "known path": known_path,
}


def _played(on: Pass, one: Round, job: Job) -> Array:
    return on.drive.played(job).trajectory.states[0, 1:, :2].astype(np.float64)


def errors_m(on: Pass, names: list[str] | None = None) -> dict[str, Array]:
    """Return by forecast the distances (R, T) of a pass's rounds, at `TIMES_S`."""
    found: dict[str, list[Array]] = {name: [] for name in names or FORECASTS}
    for one in on.rounds:
        true = on.true_xy_m(one)
        for name, rows in found.items():
            rows.append(np.hypot(*(FORECASTS[name](on, one) - true).T))
    return {name: np.array(rows) for name, rows in found.items()}


def mean_up_to(errors: Array) -> list[float]:
    """Return the mean over rounds and instants up to each of `UP_TO_S`."""
    return [float(errors[:, until + 1e-6 >= TIMES_S].mean()) for until in UP_TO_S]


def rows(name: str, errors: dict[str, Array]) -> list[str]:
    """Return the rows of the table of one pass."""
    count = len(next(iter(errors.values())))
    return [
        f"| {name} ({count}) | {forecast} | "
        + " | ".join(f"{mean:.3f}" for mean in mean_up_to(found))
        + " |"
        for forecast, found in errors.items()
    ]


def main(arguments: list[str]) -> int:
    """Print the table."""
    asked = asked_passes("tests.trust.nominal", arguments)
    print("| pass (rounds) | forecast | 1 s | 2 s | 4 s | 8 s |\n|" + " --- |" * 6)
    of_drive: dict[str, list[dict[str, Array]]] = {}
    for on in asked:
        if not on.rounds:
            continue
        drive, drawn = on.name.split()[0], "drawn" in on.name
        found = errors_m(on)
        of_drive.setdefault(f"{drive}, drawn" if drawn else on.name, []).append(found)
    for name, parts in of_drive.items():
        joined = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        print("\n".join(rows(name, joined)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
