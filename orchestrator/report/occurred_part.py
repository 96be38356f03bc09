"""The section on what really occurred in a drive: scenarios recognised, held against thresholds."""

from __future__ import annotations

import math
from collections.abc import Sequence

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.occurred.occurred import Occurred, occurred_in
from foretwin.orchestrator.report.blocks import (
    UNKNOWN,
    Block,
    Chapter,
    Listed,
    Prose,
    TableCell,
    number,
    plural,
    row,
)
from foretwin.orchestrator.report.material import RunMaterial
from foretwin.orchestrator.report.passages import JunctionPassed
from foretwin.sim_worker.analysis.occurred.conflicts import conflicts_of
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario

_MOST_LISTED = 300


def occurred_part(run: RunMaterial, passed: Sequence[JunctionPassed]) -> Chapter:
    """Return what occurred in a run's drive; why nothing is known of it where that is so."""
    try:
        found = occurred_in(run.folder, recorded=run.recorded)
    except (UserError, OSError) as error:
        why = "nothing is recorded" if isinstance(error, OSError) else str(error).split(": ", 1)[-1]
        return _chapter((Prose(f"What occurred cannot be told: {why}."),))
    chapter = told_of(found, run.start_stamp_ns, passed)
    if most := (run.record.get("virtual_traffic") or {}).get("most_users"):
        said = f"Virtual traffic, {plural(most, 'road user')} at most, counts for nothing here."
        chapter = chapter._replace(blocks=(*chapter.blocks, Prose(said, "quiet")))
    return chapter


def told_of(found: Occurred, start_ns: int, passed: Sequence[JunctionPassed]) -> Chapter:
    """Return the section of what was recognised; drive time begins at `start_ns`."""
    blocks: list[Block] = [Prose(f"{note[:1].upper()}{note[1:]}.", "quiet") for note in found.notes]
    beyond = sum(one.is_conflict for one in found.scenarios)
    conflicts = plural(len(conflicts_of(found.scenarios)), "conflict")
    blocks.insert(
        0,
        Prose(
            f"{plural(len(found.scenarios), 'scenario')} recognised from the recorded motion and "
            f"detections; {beyond} of them beyond a threshold ({conflicts})."
        ),
    )
    if found.scenarios:
        rows = tuple(_row(one, start_ns, passed) for one in found.scenarios[:_MOST_LISTED])
        columns = (
            "from",
            "to",
            "what",
            "with",
            "junction",
            "TTC",
            "PET",
            "headway",
            "beyond",
            "tags",
        )
        blocks.append(
            Listed(
                "What occurred", columns, rows, frozenset({0, 1, 5, 6, 7}), folded=len(rows) > 40
            )
        )
    return _chapter(tuple(blocks))


def _chapter(blocks: tuple[Block, ...]) -> Chapter:
    return Chapter("occurred", "What really occurred", blocks)


def _passage(
    one: OccurredScenario, start_ns: int, passed: Sequence[JunctionPassed]
) -> JunctionPassed | None:
    """Return the passage of its junction that was nearest in time."""
    middle_s = ((one.begin_ns + one.end_ns) / 2 - start_ns) / 1e9
    return min(
        (at for at in passed if str(at.place["id"]) == one.junction_id),
        key=lambda at: math.inf if at.arrived_s is None else abs(at.arrived_s - middle_s),
        default=None,
    )


def _row(
    one: OccurredScenario, start_ns: int, passed: Sequence[JunctionPassed]
) -> tuple[TableCell, ...]:
    at = _passage(one, start_ns, passed)
    return row(
        number((one.begin_ns - start_ns) / 1e9, 1, "s"),
        number((one.end_ns - start_ns) / 1e9, 1, "s"),
        _what(one),
        f"{one.other_kind} {one.other_id}".strip() or UNKNOWN,
        TableCell(at.name, to=at.anchor) if at else TableCell(one.junction_id or UNKNOWN),
        number(one.ttc_s, 1, "s"),
        number(one.pet_s, 1, "s"),
        number(one.time_headway_s, 1, "s"),
        TableCell(", ".join(one.beyond), tone="watch" if one.beyond else ""),
        ", ".join(one.tags),
    )


def _what(one: OccurredScenario) -> str:
    """Return a scenario in words, with its side where the word does not end in it."""
    kind = one.kind.replace("_", " ")
    return f"{kind}, {one.side}" if one.side and not kind.endswith(one.side) else kind
