"""How good forecasts of a car's own progress are, over real drives.

    python -m tests.trust.progress [NAME ...] [--split tuning|held_out] [--table FILE]

prints a row for each drive that moves for half a minute, calibrated as it would be while driving
and scored by the smoothed truth: without any map (`blind`), and with the bends of the way that was
then driven, as the reference has it that knows the path. Drives that the shipped table was learnt
from are marked, and left out of what is pooled.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.forecast import PROGRESS_TIMES_S
from foretwin.orchestrator.forecast.examples import Examples, causal_states, examples_of
from foretwin.orchestrator.forecast.progress_model import ProgressModel, progress_of
from foretwin.orchestrator.forecast.scoring import BAND, DriveScore, score
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.trust.drives import RealDrive, all_drives
from tests.trust.truth import truth_of

_LEARNT = ("chemnitz", "boulder", "boulder-no-std", "dresden-1")
LEARNT_FROM = (*_LEARNT, *(f"{name}-1hz" for name in _LEARNT))
LEAST_ROUNDS, LONG_S = 60, 300.0
RANKS = 10
_HEAD = (
    "| drive | rounds | p10 to p90 hold: table, calibrated | at 1, 2, 4, 8 s "
    "| width m, to reference | CRPS m: table, calibrated, to constant acceleration "
    "| median off at 1, 2, 4, 8 s | constant speed "
    "| constant acceleration |"
)


class DriveForecasts(NamedTuple):
    """A drive's forecasts without a map, and with the way that was then driven."""

    name: str
    seconds: float
    blind: DriveScore
    seeing: DriveScore


def true_distances(drive: RealDrive, examples: Examples) -> Array:
    """Return (N, T) how far the car really went after each example."""
    truth = truth_of(drive)
    stamp_ns, way = truth.track.stamp_ns, truth.way_m
    since_s = (stamp_ns - stamp_ns[0]) * 1e-9
    start_s = (examples.stamp_ns - stamp_ns[0]) * 1e-9
    until_s = start_s[:, None] + np.array(PROGRESS_TIMES_S)
    return np.asarray(np.interp(until_s, since_s, way) - np.interp(start_s, since_s, way)[:, None])


def forecasts_of(drive: RealDrive, model: ProgressModel) -> DriveForecasts | None:
    """Return a drive's forecasts, None where it moves for less than half a minute."""
    examples = examples_of(causal_states(drive.log(), load_vehicle()))
    if np.count_nonzero(examples.speed_mps >= 0.5) < LEAST_ROUNDS:
        return None
    truth = true_distances(drive, examples)
    seconds = float(examples.stamp_ns[-1] - examples.stamp_ns[0]) / 1e9
    both = [score(model, examples, blind=blind, truth_m=truth) for blind in (True, False)]
    return DriveForecasts(drive.name, seconds, *both)


def row(found: DriveForecasts) -> str:
    """Return a drive's figures as a row of the table."""
    blind, seeing = found.blind, found.seeing
    inside = (blind.share >= BAND[0]) & (blind.share <= BAND[1])
    steady = float(blind.constant_accel_off_m.mean())
    mark = " (learnt from)" if found.name in LEARNT_FROM else ""
    return (
        f"| {found.name}{mark} | {len(blind.share)} | {blind.table_coverage:.3f}, "
        f"{blind.coverage:.3f} | {_at(inside.astype(float))} | {blind.width_m.mean():.2f}, "
        f"{blind.width_m.mean() / seeing.width_m.mean():.2f} "
        f"| {blind.table_crps_m.mean():.2f}, {blind.crps_m.mean():.2f}, "
        f"{blind.crps_m.mean() / steady:.2f} | {_at(blind.median_off_m)} "
        f"| {_at(blind.constant_speed_off_m)} | {_at(blind.constant_accel_off_m)} |"
    )


def _at(values: Array) -> str:
    return ", ".join(f"{values[:, k].mean():.2f}" for k in (0, 1, 3, 7))


def pooled(found: Sequence[DriveForecasts]) -> list[str]:
    """Return what holds of all rounds of the long drives that were not learnt from."""
    some = [one for one in found if one.name not in LEARNT_FROM and one.seconds >= LONG_S]
    if not some:
        return []
    share = np.concatenate([one.blind.share.ravel() for one in some])
    held = np.mean((share >= BAND[0]) & (share <= BAND[1]))
    table = np.concatenate([one.blind.table_share.ravel() for one in some])
    table_held = np.mean((table >= BAND[0]) & (table <= BAND[1]))
    ranks = np.histogram(share, bins=RANKS, range=(0.0, 1.0))[0] / len(share)
    width = np.concatenate([one.blind.width_m.ravel() for one in some]).mean()
    reference = np.concatenate([one.seeing.width_m.ravel() for one in some]).mean()
    return [
        f"Pooled over {len(some)} drives of five minutes and more that were not learnt from: "
        f"p10 to p90 hold {held:.3f} (table alone {table_held:.3f}); width to the reference's "
        f"{width / reference:.2f}",
        "Ranks: " + ", ".join(f"{part:.3f}" for part in ranks),
    ]


def main(arguments: list[str]) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.trust.progress")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--split", choices=("tuning", "held_out"), default=None)
    parser.add_argument("--table", default=None)
    given = parser.parse_args(arguments)
    model = progress_of(given.table)
    assert model is not None, "off is no table"
    drives = [d for d in all_drives(given.split) if not given.names or d.name in given.names]
    print(_HEAD)
    print("|" + " --- |" * 9)
    found = []
    for drive in drives:
        one = forecasts_of(drive, model)
        if one is not None:
            found.append(one)
            print(row(one))
            sys.stdout.flush()
    print("", *pooled(found), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
