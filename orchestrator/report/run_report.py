"""The report of one drive: the first page with its verdict in a sentence, and all sections."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from foretwin.orchestrator.progress import Progress, untold
from foretwin.orchestrator.record.whereabouts import driven_s
from foretwin.orchestrator.report.blocks import (
    Block,
    Chapter,
    Drawn,
    Plotted,
    Prose,
    Report,
)
from foretwin.orchestrator.report.conduct_parts import (
    disagreement_part,
    events_part,
    losses_part,
    marks_part,
)
from foretwin.orchestrator.report.first_page import figures_of, verdict_of
from foretwin.orchestrator.report.gap_rows import HumanRow
from foretwin.orchestrator.report.junction_parts import junction_parts, junction_table
from foretwin.orchestrator.report.material import RunMaterial, in_lock_step
from foretwin.orchestrator.report.occurred_part import occurred_part
from foretwin.orchestrator.report.passages import JunctionPassed, passages
from foretwin.orchestrator.report.plots import drive_plot
from foretwin.orchestrator.report.provenance_part import provenance_part
from foretwin.orchestrator.report.reality_parts import (
    agreement_part,
    calibration_part,
    gap_part,
    prediction_part,
)
from foretwin.orchestrator.report.route_picture import route_svg
from foretwin.orchestrator.report.vehicle_parts import vehicle_part, verdict_part


def run_report(
    run: RunMaterial,
    *,
    people: Sequence[HumanRow] = (),
    pictures: bool = True,
    places: bool = True,
    progress: Progress = untold,
) -> Report:
    """Return the report of a drive; `people` is how far drivers differ on its road, where known.

    Without `pictures` nothing is drawn that shows the place, without `places` no map is named.
    """
    passed = passages(run)
    after_junctions: tuple[Callable[[], Chapter], ...] = (
        lambda: prediction_part(run),
        lambda: gap_part(run, people),
        lambda: calibration_part(run),
        lambda: agreement_part(run),
        lambda: occurred_part(run, passed),
        lambda: verdict_part(run),
        lambda: vehicle_part(run),
        lambda: disagreement_part(run, passed),
        lambda: marks_part(run),
        lambda: events_part(run),
        lambda: losses_part(run),
        lambda: provenance_part(run.folder, run.record, places=places),
    )
    with progress(len(passed) + len(after_junctions), "sections") as (advance, _):
        parts = [_junctions(run, passed, pictures=pictures, advance=advance)]
        for part in after_junctions:
            parts.append(part())
            advance(parts[-1].title)
    verdict, tone = verdict_of(run, passed)
    return Report(
        title=f"Drive {run.record.get('run_id') or run.folder.name}",
        subtitle=_subtitle(run),
        verdict=verdict,
        tone=tone,
        figures=figures_of(run, passed),
        front=tuple(_front(run, passed, pictures=pictures)),
        parts=tuple(parts),
        attribution=(run.attribution,) if run.attribution else (),
        unread=run.unread,
    )


def _subtitle(run: RunMaterial) -> str:
    record = run.record
    seconds = driven_s(record)
    config = record.get("config") or {}
    said = [
        "no record of it" if not record else f"ended: {record.get('exit') or 'not told'}",
        "" if seconds is None else f"{seconds:.1f} s driven",
        f"source: {config['source']}" if config.get("source") else "",
        f"planner: {config['planner']}" if config.get("planner") else "",
    ]
    return " · ".join(one for one in said if one)


def _front(run: RunMaterial, passed: Sequence[JunctionPassed], *, pictures: bool) -> list[Block]:
    blocks: list[Block] = []
    svg = route_svg(run.track, run.worlds(), passed) if pictures else None
    if svg is not None:
        caption = (
            "The way driven, from the white dot on; junctions by number, each a link to its "
            f"section (amber and red: something critical was foreseen there). {run.attribution}"
        )
        blocks.append(Drawn(svg, caption, wide=True))
    elif pictures:
        blocks.append(
            Prose("No map: neither the way nor a junction of this drive is recorded.", "quiet")
        )
    if run.track is not None:
        arrivals = [(one.number, one.arrived_s) for one in passed if one.arrived_s is not None]
        blocks.append(
            Plotted(
                drive_plot(run.track, arrivals), "Speed, and where the car was at each junction."
            )
        )
    return blocks


def _junctions(
    run: RunMaterial,
    passed: Sequence[JunctionPassed],
    *,
    pictures: bool,
    advance: Callable[[str], None],
) -> Chapter:
    title = "Junction by junction"
    if not passed:
        text = "The car met no junction in this drive: nothing was foreseen."
        return Chapter("junctions", title, (Prose(text),))
    parts = []
    for part in junction_parts(run, passed, pictures=pictures):
        parts.append(part)
        advance(part.title)
    table = junction_table(passed, lock_step=in_lock_step(run.record))
    return Chapter("junctions", title, (table,), tuple(parts))
