"""The tables of docs/scale.md, and how they get there."""

from __future__ import annotations

import math
import re
import statistics
from collections.abc import Iterable, Sequence
from pathlib import Path

from tests.scale.fit import predictions
from tests.scale.measured import Measured
from tests.scale.plan import (
    CARS,
    FUTURES_PER_JOB,
    WORKERS,
    Prices,
    cars_at_scale,
    costs_of,
    one_parent,
    sweep_at_scale,
)
from tests.scale.sweep_runs import PARTS, SweepRun

DOC = Path(__file__).parents[2] / "docs" / "scale.md"
SWEEPS = (1e6, 1e9)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def service(measured: Measured) -> str:
    """Return what a job of 64 takes by part, and what the rest takes."""
    runs = measured.runs_of(1, FUTURES_PER_JOB)
    parts = {name: statistics.median(r.parts_s[name] for r in runs) for name in (*PARTS, "other")}
    whole_s = sum(parts.values())
    costs, worlds, car = costs_of(measured), measured.worlds, measured.car
    rows = [
        *((f"job: {name}", _ms(parts[name]), f"{parts[name] / whole_s:.0%}") for name in parts),
        ("job, all of it", _ms(whole_s), "100%"),
        ("job, fitted: fixed", _ms(costs.job_s), ""),
        ("job, fitted: each future", _ms(costs.future_s), ""),
        ("job, fitted: first in a World at a worker", _ms(costs.first_s), ""),
        ("parent: each job", _ms(costs.parent_job_s), ""),
        ("parent: each future", _ms(costs.parent_future_s), ""),
        ("a World: build", _ms(worlds.build_cpu_s), ""),
        ("a World: find places", _ms(worlds.place_cpu_s), ""),
        ("a World: compile", _ms(worlds.compile_cpu_s), ""),
        ("a worker's start", _ms(statistics.median(r.starting_cpu_s for r in runs)), ""),
        ("live: jobs of a round, median", _ms(statistics.median(car.rounds_cpu_s)), ""),
        ("live: orchestrator, each round", _ms(car.start_s + car.end_s), ""),
        ("live: orchestrator, each sample", _ms(car.sample_cpu_s), ""),
        ("live: orchestrator, all it does (cores)", f"{car.orchestrator_cores:.3f}", ""),
    ]
    return table(("CPU time", "ms", "of a job"), rows)


def weights(measured: Measured) -> str:
    """Return what is sent and stored, in bytes."""
    stored, car = measured.stored, measured.car
    rows = [
        ("sweep: question of a job of 64", _kb(stored.question_bytes)),
        ("sweep: answer with its rows", _kb(stored.answer_bytes)),
        ("sweep: Parquet, each job's files, empty", _kb(stored.part_bytes)),
        ("sweep: Parquet, each future", f"{stored.row_bytes:.0f} B"),
        ("a World's file", _kb(measured.worlds.file_bytes)),
        ("live: question of a job of 32", _kb(car.question_bytes)),
        ("live: answer with its trajectories", _kb(car.answer_bytes)),
        ("live: telemetry of a car", f"{_kb(car.telemetry_bytes_per_s)}/s"),
        ("live: recording and results of a car", f"{_kb(car.recorded_bytes_per_s)}/s"),
    ]
    return table(("what", "bytes"), rows)


def held_out(measured: Measured) -> str:
    """Return how well the sweeps that were not fitted are predicted."""
    rows = [
        (
            f"{one.workers} workers, jobs of {one.futures_per_job}",
            one.what,
            f"{statistics.median(one.predicted_s):.2f}",
            f"{statistics.median(one.measured_s):.2f} "
            f"({min(one.measured_s):.2f} to {max(one.measured_s):.2f})",
            f"{one.median_error:+.1%} ({min(one.errors):+.1%} to {max(one.errors):+.1%})",
        )
        for one in predictions(measured)
    ]
    head = ("held out", "what", "predicted, s", "measured, s", "error")
    return table(head, rows)


def speed_up(measured: Measured) -> str:
    """Return what two workers are against one, repeat by repeat side by side."""
    rows = []
    for size in (16, FUTURES_PER_JOB):
        pairs = list(zip(measured.runs_of(1, size), measured.runs_of(2, size), strict=True))
        twos = [two for _, two in pairs]
        gaps = [
            gap for run in twos for worker in run.by_worker().values() for gap in worker.gaps_s[1:]
        ]
        rows.append(
            (
                f"{size}",
                _spread(one.unhindered_s / two.unhindered_s for one, two in pairs),
                _spread(2.0 * one.jobs_cpu_s / two.jobs_cpu_s for one, two in pairs),
                _spread(one.makespan_s / two.makespan_s for one, two in pairs),
                f"{statistics.median(two.idle_share for two in twos):.1%}",
                _ms(statistics.median(gaps)),
                f"{statistics.median(_others(run) for pair in pairs for run in pair):.1f}",
            )
        )
    head = (
        "futures a job", "as on idle cores", "by CPU time alone", "by the wall",
        "idle share of two workers", "between two jobs, ms", "cores others took",
    )  # fmt: skip
    return table(head, rows)


def workers(measured: Measured) -> str:
    """Return what one parent gets out of so many workers."""
    costs = costs_of(measured)
    alone = one_parent(costs, 1).futures_per_s
    found = {count: one_parent(costs, count) for count in WORKERS}
    rows = [
        (
            f"{count}",
            f"{one.futures_per_s:,.0f}",
            f"{one.futures_per_s / alone / count:.0%}",
            f"{one.parent_use:.0%}",
        )
        for count, one in found.items()
    ]
    return table(("workers", "futures/s", "of ideal", "parent's use"), rows)


def sweeps(measured: Measured) -> str:
    """Return what large sweeps cost."""
    rows = []
    for futures in SWEEPS:
        one = sweep_at_scale(measured, futures, Prices())
        rows.append(
            (
                f"10^{math.log10(futures):.0f}",
                f"{one.core_hours:,.2f}",
                f"{3.6 * one.core_hours:,.0f} s",
                f"{one.stored_bytes / 1e9:,.1f} GB",
                f"{one.files:,.0f}",
                f"{one.bus_bytes / 1e9:,.1f} GB",
                " + ".join(f"{part:,.2f}" for part in one.dollars),
            )
        )
    head = (
        "futures", "core-hours", "on 1,000 cores", "Parquet", "files", "over the bus",
        "US$: cores + putting files + a month",
    )  # fmt: skip
    return table(head, rows)


def cars(measured: Measured) -> str:
    """Return what cars need of a shared cluster."""
    rows, prices = [], Prices()
    for count in CARS:
        one = cars_at_scale(measured, count)
        dollars = one.cores * prices.core_hour
        rows.append(
            (
                f"{count:,}",
                f"{one.seats:,} ({one.seats / count:.2f})",
                " / ".join(_ms(one.rounds.percentile_s(percent)) for percent in (50, 95)),
                f"{one.rounds.late_share:.2%}",
                f"{one.rounds.core_use:.0%}",
                f"{one.cores:,.1f}",
                f"{one.bus_bytes_per_s / 1e6:,.1f} MB/s ({one.rounds.link_use:.0%} of 10 Gbit/s)",
                f"{one.telemetry_bytes_per_s / 1e6:,.2f} MB/s",
                f"{dollars / count:.3f}",
            )
        )
    head = (
        "cars", "seats (each car)", "round p50 / p95, ms", "late or missed", "seats' use",
        "cores with orchestrators", "rounds on the bus", "telemetry", "US$ an hour and car, cores",
    )  # fmt: skip
    return table(head, rows)


TABLES = {
    "service": service, "weights": weights, "held-out": held_out, "speed-up": speed_up,
    "workers": workers, "sweeps": sweeps, "cars": cars,
}  # fmt: skip
"""By the name that stands in the page."""


def written_into(page: str, measured: Measured, names: Iterable[str] = TABLES) -> str:
    """Return the page with its tables made anew; raises ValueError where one has no place."""
    for name in names:
        place = re.compile(rf"(<!-- table {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = TABLES[name](measured)
        page, found = place.subn(lambda match, text=text: f"{match[1]}{text}\n{match[2]}", page)  # type: ignore[misc]
        if found != 1:
            raise ValueError(f"{DOC}: table {name} has {found} places, not one")
    return page


def _others(run: SweepRun) -> float:
    return run.others_cores


def _spread(values: Iterable[float]) -> str:
    found = sorted(values)
    return f"{statistics.median(found):.2f} ({found[0]:.2f} to {found[-1]:.2f})"


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}"


def _kb(count: float) -> str:
    return f"{count / 1e3:.3g} kB"
