"""How much of the nominal future's error comes of bends: those of its path, and as they are driven.

    python -m tests.trust.bends [NAME ...] [--group given|tuned_on|held_out]

prints for each drive the parts along and across the way of the nominal future and of the known
path, mean metres over all instants up to 2 s; and of the way that was driven within 2 s, above
4 m/s, how much was driven faster than the planners take its bends: as its path has them, and as
they were driven.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import kept_apart, tangents
from foretwin.sim_worker.driver_model import COMFORT_DECEL_MPS2, LATERAL_ACCEL_MPS2
from tests.orchestrator.in_process_drive import Round
from tests.trust.nominal import known_path, nominal
from tests.trust.nominal_passes import TIMES_S, Pass, asked_passes

UPTO_S = 2.0
MOVING_MPS = 4.0
_WAY_S = np.arange(-2.0, 12.0, 0.1)
_LEAST_STEP_M = 0.8
_SLACK_MPS = 0.3
"""So much faster is not counted: smoothing is no better."""


class Parts(NamedTuple):
    """Errors (T,) along and across the way that was driven, in metres."""

    along_m: Array
    across_m: Array


def parts(forecast_xy_m: Array, true_xy_m: Array) -> Parts:
    """Return the parts of a forecast's errors, both (T, 2); while the car stands all is along."""
    (x, y), way = (forecast_xy_m - true_xy_m).T, tangents(true_xy_m)
    across = y * way[:, 0] - x * way[:, 1]
    return Parts(np.sqrt(np.maximum(x**2 + y**2 - across**2, 0.0)), np.abs(across))


def too_fast(path_xy_m: Array, xy_m: Array, speed_mps: Array) -> Flags:
    """Return where, of places (K, 2) driven at `speed_mps` (K,), a path's bends are slower."""
    path = FrenetPath(path_xy_m)
    allowed = path.speed_profile(
        lateral_accel_mps2=LATERAL_ACCEL_MPS2, decel_mps2=COMFORT_DECEL_MPS2
    )
    return np.asarray(path.at_nodes(allowed, path.locate(xy_m).arc_m) < speed_mps - _SLACK_MPS)


def _too_fast(on: Pass, one: Round) -> tuple[Flags, Flags] | None:
    """Of the places of a round's next seconds: on its path, and on that which was driven."""
    way = on.true_xy_m(one, _WAY_S)
    step = np.hypot(*np.diff(way, axis=0).T) / 0.1
    moving = (_WAY_S[:-1] >= 0.0) & (_WAY_S[:-1] < UPTO_S) & (step > MOVING_MPS)
    if not moving.any():
        return None
    places, speed = way[:-1][moving], step[moving]
    driven = way[kept_apart(way, least_m=_LEAST_STEP_M)]
    return too_fast(one.job.path.xy_m, places, speed), too_fast(driven, places, speed)


def row(name: str, rounds: list[tuple[Pass, Round]]) -> str:
    """Return the row of the table of a drive's rounds."""
    near = UPTO_S + 1e-6 >= TIMES_S
    cells = [f"{name} ({len(rounds)})"]
    for forecast in (nominal, known_path):
        found = [parts(forecast(on, one), on.true_xy_m(one)) for on, one in rounds]
        along, across = (np.array(part)[:, near].mean() for part in zip(*found, strict=True))
        cells.append(f"{along:.2f}, {across:.2f}")
    fast = [both for on, one in rounds if (both := _too_fast(on, one)) is not None]
    shares = [100.0 * np.concatenate(part).mean() for part in zip(*fast, strict=True)]
    cells.append(", ".join(f"{share:.0f} %" for share in shares))
    return "| " + " | ".join(cells) + " |"


def main(arguments: list[str]) -> int:
    """Print the table."""
    asked = asked_passes("tests.trust.bends", arguments)
    rounds: dict[str, list[tuple[Pass, Round]]] = {}
    for on in asked:
        rounds.setdefault(on.name.split()[0], []).extend((on, one) for one in on.rounds)
    print("| drive (rounds) | nominal: along, across | known path | too fast: path, driven |")
    print("|" + " --- |" * 4)
    for name, of_drive in rounds.items():
        print(row(name, of_drive), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
