"""The picture of docs/scale.md: prediction against measurement, one parent, cars on seats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from tests.scale.fit import predictions
from tests.scale.measured import Measured
from tests.scale.plan import (
    CARS,
    FUTURES_PER_JOB,
    SEATS_PER_CAR,
    WORKERS,
    car_costs,
    costs_of,
    one_parent,
    rounds_of,
)

PICTURE = Path(__file__).parents[2] / "docs" / "scale.png"
_MARKS = {"CPU of the jobs": "o", "wall, idle cores": "s", "wall, as it was": "^"}


def draw(measured: Measured, file: Path = PICTURE) -> None:
    """Draw all three into a file."""
    figure = Figure(figsize=(13.5, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    left, middle, right = figure.subplots(1, 3)
    _held_out(left, measured)
    _parent(middle, measured)
    _cars(right, measured)
    figure.savefig(file, dpi=90)


def _held_out(axes: Any, measured: Measured) -> None:
    found = predictions(measured)
    most = max(max(*one.measured_s, *one.predicted_s) for one in found)
    least = min(min(*one.measured_s, *one.predicted_s) for one in found)
    ends = [0.8 * least, 1.25 * most]
    axes.plot(ends, ends, color="0.5", lw=1)
    axes.fill_between(ends, [0.85 * e for e in ends], [1.15 * e for e in ends], color="0.9")
    for one in found:
        label = f"{one.workers} workers, jobs of {one.futures_per_job}: {one.what}"
        marks = axes.plot(one.measured_s, one.predicted_s, _MARKS[one.what], ms=5, label=label)
        marks[0].set_alpha(0.8)
    axes.set(xscale="log", yscale="log", xlabel="measured, s", ylabel="predicted, s")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_title("Sweeps that were not fitted (band: 15 %)", fontsize=10)
    axes.legend(fontsize=6.5)


def _parent(axes: Any, measured: Measured) -> None:
    costs = costs_of(measured)
    alone = one_parent(costs, 1).futures_per_s
    axes.plot(WORKERS, [alone * n for n in WORKERS], color="0.6", ls="--", lw=1, label="ideal")
    found = [one_parent(costs, n).futures_per_s for n in WORKERS]
    axes.plot(WORKERS, found, "o-", ms=4, label="one parent")
    for count in (1, 2):
        runs = measured.runs_of(count, FUTURES_PER_JOB)
        axes.plot([count] * len(runs), [r.futures / r.unhindered_s for r in runs], "kx", ms=6)
    axes.plot([], [], "kx", label="measured, as on idle cores")
    axes.set(xscale="log", yscale="log", xlabel="workers", ylabel="futures per second")
    axes.set_title("One sweep, jobs of 64", fontsize=10)
    axes.legend(fontsize=7)


def _cars(axes: Any, measured: Measured) -> None:
    costs = car_costs(measured)
    for cars in CARS:
        seats = sorted({max(round(share * cars), 1) for share in SEATS_PER_CAR})
        late = [100.0 * rounds_of(costs, cars, n).late_share for n in seats]
        axes.plot([n / cars for n in seats], late, "o-", ms=4, label=f"{cars:,} cars")
    axes.axhline(1.0, color="0.6", lw=1, ls="--")
    axes.set(xlabel="seats for each car", ylabel="% of rounds late or missed", xlim=(0.0, 1.6))
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set_ylim(0.0, 100.0)
    axes.set_title("Two rounds a second of 64 futures", fontsize=10)
    axes.legend(fontsize=8)
