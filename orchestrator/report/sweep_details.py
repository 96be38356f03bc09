"""Sections of a sweep's report: its metrics, what was left out and why, what was lost."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from foretwin.orchestrator.report.blocks import (
    UNKNOWN,
    Block,
    Chapter,
    Listed,
    Plotted,
    Prose,
    TableCell,
    number,
    row,
)
from foretwin.orchestrator.report.junction_parts import title_of
from foretwin.orchestrator.report.plots import histogram_plot
from foretwin.orchestrator.report.sweep_material import SweepMaterial

MOST_ROWS = 400
"""So many rows of a table are listed."""
_PLOTTED = 6
"""So many metrics are drawn, the first of the table that differ."""


def scenario_title(scenario_id: str) -> str:
    """Return what a scenario is called."""
    return title_of({"scenario": scenario_id, "name": scenario_id})


def metrics_chapter(sweep: SweepMaterial) -> Chapter:
    """Return how the metrics of a sweep spread, by planner."""
    title = "Metrics"
    means = sweep.metric_means()
    rows: list[tuple[TableCell, ...]] = []
    plots: list[Plotted] = []
    for name, (unit, better) in means.items():
        values = sweep.values_of(f"metric_{name}")
        for planner, mine in values.items():
            quantiles = np.quantile(mine, (0.05, 0.5, 0.95)) if len(mine) else [None] * 3
            cells = [number(None if q is None else float(q), 3) for q in quantiles]
            rows.append(
                row(
                    name.replace("_", " "),
                    unit,
                    better,
                    planner,
                    number(float(len(mine)), 0),
                    *cells,
                )
            )
        if len(plots) < _PLOTTED and any(len(np.unique(mine)) > 2 for mine in values.values()):
            label = f"{name.replace('_', ' ')}{'' if unit == '1' else f', {unit}'}"
            caption = f"{label}: {better} is better." if better != "neither" else f"{label}."
            plots.append(Plotted(histogram_plot(values, label), caption))
    if not rows:
        return Chapter("metrics", title, (Prose("The sweep measured no metrics."),))
    table = Listed(
        "Of the cases that were played, by planner",
        ("metric", "unit", "better", "planner", "known of", "5 %", "median", "95 %"),
        tuple(rows),
        frozenset({4, 5, 6, 7}),
        folded=True,
    )
    return Chapter("metrics", title, (*plots, table))


def left_out_chapter(sweep: SweepMaterial) -> Chapter:
    """Return which cases could not be played, and why."""
    title = "What was left out, and why"
    counted: Counter[tuple[str, str]] = Counter(
        (one["scenario"], one["left_out"])
        for one in sweep.futures.select(["scenario", "left_out"]).to_pylist()
        if one["left_out"]
    )
    rows = tuple(
        row(scenario_title(scenario), why, number(float(count), 0))
        for (scenario, why), count in counted.most_common(MOST_ROWS)
    )
    blocks: list[Block] = []
    if rows:
        blocks.append(
            Listed(
                "Cases that cannot happen where they were placed",
                ("scenario", "why", "rows"),
                rows,
                frozenset({2}),
            )
        )
    else:
        blocks.append(Prose("No case was left out."))
    nowhere = sweep.record.get("placed_nowhere") or []
    if nowhere:
        named = ", ".join(scenario_title(one) for one in nowhere)
        blocks.append(Prose(f"Placed nowhere: {named}."))
    unplaced = sweep.record.get("unplaced") or []
    if unplaced:
        blocks.append(
            Listed(
                "Places that were not found",
                ("what",),
                tuple(row(_words(one)) for one in unplaced[:MOST_ROWS]),
                folded=True,
            )
        )
    return Chapter("left-out", title, tuple(blocks))


def _words(one: Any) -> str:
    if isinstance(one, dict):
        return ", ".join(f"{name}: {value}" for name, value in one.items())
    return str(one)


def losses_chapter(sweep: SweepMaterial) -> Chapter:
    """Return what became of the jobs, and what failed."""
    record = sweep.record
    jobs = (record.get("ledger") or {}).get("jobs") or {}
    told = tuple(row(name, number(float(count), 0)) for name, count in jobs.items())
    blocks: list[Block] = []
    if told:
        blocks.append(Listed("Jobs", ("what", "count"), told, frozenset({1})))
    else:
        blocks.append(Prose("The sweep's record holds no ledger: it was never ended.", "watch"))
    failed = [
        row(scenario_title(one["scenario"]), one["planner"], why, number(float(count), 0))
        for one in record.get("scenarios") or []
        for why, count in one["reasons"].items()
    ]
    failed += [
        row("a World", UNKNOWN, f"{place}: {why}", "")
        for place, why in (record.get("failures") or {}).items()
    ]
    if failed:
        blocks.append(
            Listed(
                "What failed", ("scenario", "planner", "why", "rows"), tuple(failed), frozenset({3})
            )
        )
    return Chapter("losses", "Losses", tuple(blocks))
