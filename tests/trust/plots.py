"""Pictures of docs/trust.md: calibration, consistency, and where the nominal future ends up.

    python -m tests.trust.plots OUT.png [--pass NAME]

measures anew, by the functions that print the tables, over all drives that are there.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.orchestrator.forecast.progress_model import progress_of
from tests.trust.consistency import Consistency, consistency_of
from tests.trust.drives import all_drives
from tests.trust.nominal import errors_m
from tests.trust.nominal_passes import TIMES_S, passes
from tests.trust.progress import LEARNT_FROM, DriveForecasts, forecasts_of
from tests.trust.states import states_of
from tests.trust.truth import truth_of

_LONG_S = 300.0
_SHADES = {"position": "#4c78a8", "yaw": "#f58518", "speed": "#54a24b"}
_WIDTHS = {"nominal": 2.6}


def reliability(axes: Any, drives: Sequence[tuple[str, Array, bool]]) -> None:
    """Draw what part of outcomes lay below each share of forecasts: by name, shares (N, T), and
    whether the drive was held out."""
    levels = np.linspace(0.0, 1.0, 41)
    axes.plot([0, 1], [0, 1], color="0.6", lw=1, ls="--")
    for name, share, held_out in drives:
        came = np.searchsorted(np.sort(share.ravel()), levels, side="right") / share.size
        axes.plot(levels, came, lw=1.8 if held_out else 0.9, label=name)
    axes.set(xlabel="share of the forecast", ylabel="of outcomes below it", title="Calibration")
    axes.legend(fontsize=6)


def consistency(axes: Any, drives: Mapping[str, Consistency]) -> None:
    """Draw the share of errors within what states call 95 %, drive by drive."""
    row = np.arange(len(drives))
    for k, (what, colour) in enumerate(_SHADES.items()):
        shares = [100.0 * getattr(found, f"{what}_within") for found in drives.values()]
        axes.barh(row + 0.27 * (1 - k), shares, 0.26, color=colour, label=what)
    axes.axvspan(90.0, 99.0, color="0.85", zorder=0)
    axes.set_yticks(row, list(drives), fontsize=6)
    axes.invert_yaxis()
    axes.set(xlabel="% of errors within the state's 95 %", title="Consistency (asked: 90 to 99)")
    axes.legend(fontsize=6, loc="lower left")


def by_horizon(axes: Any, errors: Mapping[str, Array], name: str) -> None:
    """Draw the mean error up to each instant, of forecasts' distances (R, T) at `TIMES_S`."""
    for forecast, found in errors.items():
        mean = np.cumsum(found.mean(axis=0)) / np.arange(1, len(TIMES_S) + 1)
        axes.plot(TIMES_S, mean, lw=_WIDTHS.get(forecast, 1.1), label=forecast)
    axes.set(xlabel="up to, s", ylabel="mean distance, m", title=f"Nominal future, {name}")
    axes.set_yscale("log")
    axes.legend(fontsize=6)


def _forecasts() -> list[tuple[str, Array, bool]]:
    model = progress_of(None)
    assert model is not None
    found: list[tuple[DriveForecasts, bool]] = []
    for drive in all_drives():
        one = None if drive.name in LEARNT_FROM else forecasts_of(drive, model)
        if one is not None and one.seconds >= _LONG_S:
            found.append((one, drive.split == "held_out"))
    return [(one.name, one.blind.share, held_out) for one, held_out in found]


def main(arguments: list[str]) -> int:
    """Write the pictures as one PNG."""
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    parser = argparse.ArgumentParser(prog="python -m tests.trust.plots")
    parser.add_argument("out", type=Path)
    parser.add_argument("--pass", dest="name", default="gendarmenmarkt")
    given = parser.parse_args(arguments)
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 5.4), layout="constrained")
    reliability(left, _forecasts())
    found = {}
    for drive in all_drives():
        truth = truth_of(drive)
        found[drive.name] = consistency_of(states_of(drive.log(), truth.frame), truth)
    consistency(middle, found)
    with tempfile.TemporaryDirectory() as folder:
        parts = [errors_m(on) for on in passes([given.name], [], Path(folder)) if on.rounds]
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    by_horizon(right, joined, given.name)
    figure.savefig(given.out, dpi=110)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
