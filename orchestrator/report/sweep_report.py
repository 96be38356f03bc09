"""The report of a sweep: outcomes by scenario, planner and place, worst cases, left-out ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pyarrow.compute as pc

from foretwin.contracts.terminal import command_line
from foretwin.orchestrator.progress import Progress, untold
from foretwin.orchestrator.report.blocks import (
    UNKNOWN,
    Block,
    Chapter,
    Drawn,
    KeyFigure,
    Listed,
    Prose,
    Report,
    TableCell,
    Tone,
    listed_words,
    number,
    plural,
    row,
    scientific,
)
from foretwin.orchestrator.report.junction_parts import title_of
from foretwin.orchestrator.report.junction_picture import junction_svg
from foretwin.orchestrator.report.passages import tone_of
from foretwin.orchestrator.report.provenance_part import provenance_part
from foretwin.orchestrator.report.replayed import replayed
from foretwin.orchestrator.report.sweep_details import (
    MOST_ROWS,
    left_out_chapter,
    losses_chapter,
    metrics_chapter,
    scenario_title,
)
from foretwin.orchestrator.report.sweep_material import SweepMaterial

_WORST, _PICTURES = 12, 6
_OF_THE_REST = (
    "A future that failed is not among those played: whether it would have collided is not known, "
    "and it has no score. Those that were played may be the easier cases."
)
_MISSING = "jobs that were not played"


def sweep_report(
    sweep: SweepMaterial,
    *,
    pictures: bool = True,
    places: bool = True,
    progress: Progress = untold,
) -> Report:
    """Return the report of a sweep; see `run_report` for what is left out."""
    verdict, tone = _verdict(sweep)
    makers: tuple[Callable[[], Chapter], ...] = (
        lambda: _by_place(sweep),
        lambda: _worst(sweep, pictures=pictures, advance=advance),
        lambda: metrics_chapter(sweep),
        lambda: left_out_chapter(sweep),
        lambda: losses_chapter(sweep),
        lambda: provenance_part(sweep.folder, {**sweep.record, "map": sweep.map}, places=places),
    )
    parts = []
    with progress(len(makers) + _PICTURES, "sections") as (advance, _):
        for part in makers:
            parts.append(part())
            advance(parts[-1].title)
    attribution = str(sweep.record.get("attribution") or "")
    return Report(
        title=f"Sweep {sweep.folder.name if places else ''}".strip(),
        subtitle=_subtitle(sweep),
        verdict=verdict,
        tone=tone,
        figures=_figures(sweep),
        front=(_outcomes(sweep),),
        parts=tuple(parts),
        attribution=(attribution,) if attribution else (),
        unread=() if sweep.record.get("complete") else (_MISSING,),
    )


def _subtitle(sweep: SweepMaterial) -> str:
    record = sweep.record
    planners = ", ".join((record.get("spec") or {}).get("planners") or ())
    said = [
        "complete" if record.get("complete") else "not complete: some jobs were not played",
        f"shard {record['shard']}" if record.get("shard") else "",
        plural(int(record.get("worlds") or 0), "World"),
        f"planners: {planners}" if planners else "",
    ]
    return " · ".join(one for one in said if one)


def _verdict(sweep: SweepMaterial) -> tuple[str, Tone]:
    groups = sweep.record.get("scenarios") or []
    if not sweep.futures.num_rows:
        return "The sweep holds no rows: nothing was played.", "bad"
    played, collided = (sum(one[name] for one in groups) for name in ("played", "collided"))
    by_planner = {
        planner: [
            sum(one[name] for one in groups if one["planner"] == planner)
            for name in ("collided", "played")
        ]
        for planner in sorted({one["planner"] for one in groups})
    }
    ranked = sorted(
        (
            (hit / there, planner, hit, there)
            for planner, (hit, there) in by_planner.items()
            if there
        )
    )
    were = "was" if played == 1 else "were"
    said = f"Of {plural(played, 'case')} that {were} played {collided} end in a collision"
    if len(ranked) > 1:
        fewest, most = (
            listed_words(
                [f"{who} ({hit} of {there})" for of, who, hit, there in ranked if of == at]
            )
            for at in (ranked[0][0], ranked[-1][0])
        )
        same = ", the same share with each planner"
        said += same if fewest == most else f": fewest with {fewest}, most with {most}"
    failed = int(sweep.record.get("failed") or 0)
    tone: Tone = "good" if not collided else "watch"
    if failed or not sweep.record.get("complete"):
        tone = "bad"
        said += f"; {plural(failed, 'future')} failed" if failed else "; jobs are missing"
    return f"{said}.", tone


def _figures(sweep: SweepMaterial) -> tuple[KeyFigure, ...]:
    record = sweep.record
    groups = record.get("scenarios") or []
    rows, played = int(record.get("rows") or 0), sum(one["played"] for one in groups)
    collided, failed = int(record.get("collided") or 0), int(record.get("failed") or 0)
    left_out = sum(one["not_placed_rows"] for one in groups)
    share = f"{collided / played:.0%}" if played else UNKNOWN
    worst = pc.max(sweep.futures["criticality"]).as_py() if sweep.futures.num_rows else None
    return (
        KeyFigure(str(rows), "cases", f"{played} played to their end"),
        KeyFigure(
            share, "collide", f"{collided} of {played} played", "watch" if collided else "good"
        ),
        KeyFigure(scientific(worst).text, "gravest", "highest criticality", tone_of(worst)),
        KeyFigure(str(left_out), "left out", "the scenario has no place there"),
        KeyFigure(str(failed), "failed", "not played to their end", "bad" if failed else "good"),
    )


def _outcomes(sweep: SweepMaterial) -> Listed:
    groups = sweep.record.get("scenarios") or []
    rows = tuple(
        row(
            scenario_title(one["scenario"]),
            one["planner"],
            *(number(float(one[name]), 0) for name in ("cases", "played")),
            number(float(one["collided"]), 0, tone="watch" if one["collided"] else ""),
            number(float(one["failed"]), 0, tone="bad" if one["failed"] else ""),
            number(one["median_clearance_m"], 2, "m"),
            number(one["mean_score"], 3),
            number(one.get("scored"), 0),
        )
        for one in groups
    )
    return Listed(
        "Outcome by scenario and planner",
        (
            "scenario",
            "planner",
            "cases",
            "played",
            "collide",
            "failed",
            "median clearance",
            "mean score",
            "scored",
        ),
        rows,
        frozenset(range(2, 9)),
        note=_OF_THE_REST if any(one["failed"] for one in groups) else "",
    )


def _by_place(sweep: SweepMaterial) -> Chapter:
    title = "By place"
    futures = sweep.played
    if not futures.num_rows:
        return Chapter("places", title, (Prose("No case was played to its end."),))
    keys = ["junction_id", "scenario", "planner"]
    grouped = (
        futures.group_by(keys)
        .aggregate(
            [
                ("future_id", "count"),
                ("collided", "sum"),
                ("min_clearance_m", "min"),
                ("criticality", "max"),
            ]
        )
        .sort_by([(key, "ascending") for key in keys])
    )
    rows = tuple(
        row(
            sweep.junction_name(one["junction_id"]),
            scenario_title(one["scenario"]),
            one["planner"],
            number(float(one["future_id_count"]), 0),
            number(float(one["collided_sum"] or 0), 0, tone="watch" if one["collided_sum"] else ""),
            number(one["min_clearance_m_min"], 2, "m"),
            scientific(one["criticality_max"], tone=tone_of(one["criticality_max"])),
        )
        for one in grouped.slice(0, MOST_ROWS).to_pylist()
    )
    left = max(0, grouped.num_rows - MOST_ROWS)
    table = Listed(
        "Outcome by junction, scenario and planner",
        ("junction", "scenario", "planner", "played", "collide", "least clearance", "gravest"),
        rows,
        frozenset({3, 4, 5, 6}),
        note=f"{left} more rows are not listed." if left else "",
    )
    return Chapter("places", title, (table,))


def _worst(sweep: SweepMaterial, *, pictures: bool, advance: Callable[..., None]) -> Chapter:
    title = "Worst cases"
    worst = sweep.worst(_WORST)
    if not worst:
        advance(title, by=_PICTURES)
        return Chapter("worst", title, (Prose("Nothing critical happens in any case."),))
    rows = tuple(
        row(
            title_of(one),
            one["planner"],
            sweep.junction_name(one["junction_id"]),
            scientific(one["likelihood"]),
            scientific(one["criticality"], tone=tone_of(one["criticality"])),
            _hit(one),
            number(one["accident_ego_delta_v_mps"], 1, "m/s"),
            TableCell(repeat_of(sweep, one["future_id"]), code=True),
        )
        for one in worst
    )
    table = Listed(
        "Most critical first, one of each scenario, planner and junction",
        ("case", "planner", "junction", "likelihood", "criticality", "ends", "delta-v", "again"),
        rows,
        frozenset({3, 4, 6}),
    )
    drawn: list[Block] = []
    shown = worst[:_PICTURES] if pictures else []
    for future in shown:
        if picture := _picture(sweep, future):
            drawn.append(picture)
        advance(title_of(future))
    advance(title, by=_PICTURES - len(shown))
    return Chapter("worst", title, (table, *drawn))


def repeat_of(sweep: SweepMaterial, future_id: str) -> str:
    """Return the command that plays a case again."""
    return command_line("repeat", sweep.called, future_id)


def _hit(one: Mapping[str, Any]) -> str:
    if not one["collided"]:
        return f"{one['progress_m'] or 0.0:.0f}\u00a0m on"
    what = one["accident_kind"] or one["collision_with"] or "something"
    return f"hits a {what} after {one['collision_time_s']:.1f}\u00a0s"


def _picture(sweep: SweepMaterial, future: Mapping[str, Any]) -> Drawn | None:
    world = sweep.world(future["world_id"])
    if world is None:
        return None
    again = replayed(sweep.folder, [future])
    if not again.futures:
        return None
    name = sweep.junction_name(future["junction_id"])
    caption = f"{title_of(future)}, by {future['planner']}, at {name}: {_hit(future)}."
    none = np.zeros((0, 2))
    return Drawn(junction_svg(world, again.futures, none, none), caption, wide=True)
