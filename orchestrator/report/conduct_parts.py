"""Sections on who drove and what was noted: disagreements, takeovers, marks, losses, pace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from foretwin.orchestrator.report.blocks import (
    UNKNOWN,
    Block,
    Chapter,
    Facts,
    Listed,
    Plotted,
    Prose,
    TableCell,
    Tone,
    number,
    plural,
    row,
)
from foretwin.orchestrator.report.material import (
    RunMaterial,
    TableRow,
    changes_of_driver,
    in_lock_step,
    part_of,
)
from foretwin.orchestrator.report.passages import JunctionPassed
from foretwin.orchestrator.report.plots import latency_plot

MOST_LISTED = 200
"""So many rows of a kind are listed; the tables have all."""
_LEVELS: dict[str, Tone] = {"warning": "watch", "error": "bad"}


def marks_part(run: RunMaterial) -> Chapter:
    """Return what somebody in the car marked while driving."""
    marks = run.rows("marks")
    title = "Marked events"
    if not marks:
        return Chapter("marks", title, (Prose("Nobody marked an event in this drive."),))
    rows = tuple(
        row(
            _at(run, one),
            str(one.get("note") or one.get("text") or UNKNOWN),
            str(one.get("by") or ""),
        )
        for one in marks[:MOST_LISTED]
    )
    return Chapter(
        "marks",
        title,
        (Listed("Marked while driving", ("at", "note", "by"), rows, frozenset({0})),),
    )


def disagreement_part(run: RunMaterial, passed: Sequence[JunctionPassed]) -> Chapter:
    """Return where the driving software would have driven otherwise, and the takeovers."""
    title = "Human and driving software: disagreements and takeovers"
    told = run.record.get("side_by_side")
    segments, found = run.rows("driven_segments"), run.rows("disagreements")
    if not told and not segments and not found:
        text = "The car sent no plans of a driving software, so nothing of it can be compared."
        return Chapter("disagreements", title, (Prose(text),))
    anchors = {str(one.place["id"]): one for one in passed}
    blocks: list[Block] = []
    if segments:
        takeovers = plural(changes_of_driver(segments, to="manual"), "takeover")
        others = changes_of_driver(segments, to="autonomous")
        blocks.append(Prose(f"{takeovers} by the human, {others} by the software."))
        blocks.append(
            Listed(
                "Stretches between takeovers, and how far plans lay from what was driven (95 %)",
                (
                    "from",
                    "to",
                    "mode",
                    "plans",
                    "ways",
                    "across",
                    "along",
                    "speed",
                    "disagreements",
                ),
                tuple(_segment(run, one) for one in segments[:MOST_LISTED]),
                frozenset({0, 1, 3, 4, 5, 6, 7, 8}),
                note="Ways are compared across where neither car nor plan stands or hardly moves.",
            )
        )
    if found:
        blocks.append(
            Listed(
                "Disagreements",
                ("at", "what", "lasted", "across", "along", "speed", "junction"),
                tuple(_disagreement(run, one, anchors) for one in found[:MOST_LISTED]),
                frozenset({0, 2, 3, 4, 5}),
            )
        )
    else:
        blocks.append(Prose("Human and driving software did not disagree."))
    return Chapter("disagreements", title, tuple(blocks))


def _at(run: RunMaterial, one: Mapping[str, Any], name: str = "stamp_ns") -> TableCell:
    stamp = one.get(name)
    return number(None if stamp is None else (stamp - run.start_stamp_ns) / 1e9, 1, "s")


def _segment(run: RunMaterial, one: TableRow) -> tuple[TableCell, ...]:
    return row(
        _at(run, one, "from_stamp_ns"),
        _at(run, one, "to_stamp_ns"),
        one["control_mode"].replace("_", " "),
        number(float(one["plans"]), 0),
        number(one.get("ways"), 0),
        number(one["lateral_m"], 1, "m"),
        number(one["along_m"], 1, "m"),
        number(one["speed_mps"], 1, "m/s"),
        number(float(one["disagreements"]), 0),
    )


def _disagreement(
    run: RunMaterial, one: TableRow, anchors: Mapping[str, JunctionPassed]
) -> tuple[TableCell, ...]:
    at = anchors.get(one["junction_id"] or "")
    return row(
        _at(run, one),
        one["kind"].replace("_", " "),
        number(one["duration_s"], 1, "s"),
        number(one["lateral_m"], 1, "m"),
        number(one["along_m"], 1, "m"),
        number(one["speed_mps"], 1, "m/s"),
        TableCell(UNKNOWN) if at is None else TableCell(at.name, to=at.anchor),
    )


def events_part(run: RunMaterial) -> Chapter:
    """Return the warnings and errors of a drive, and the news of it."""
    events = run.rows("events")
    title = "What the drive told"
    if not events:
        return Chapter("events", title, (Prose("The drive told of nothing unusual."),))
    grave = [one for one in events if one["level"] != "info"]
    rows = tuple(
        row(
            _at(run, one),
            TableCell(one["level"], tone=_LEVELS.get(one["level"], "quiet")),
            one["source"],
            one["text"],
        )
        for one in events[:MOST_LISTED]
    )
    left = f"The first {MOST_LISTED} of {len(events)}." if len(events) > MOST_LISTED else ""
    table = Listed(
        f"{plural(len(events), 'event')}, {len(grave)} of them warnings or errors",
        ("at", "level", "from", "what"),
        rows,
        frozenset({0}),
        note=left,
        folded=len(events) > 12,
    )
    return Chapter("events", title, (table,))


def losses_part(run: RunMaterial) -> Chapter:
    """Return what became of all that was to be done: the ledger, and how long rounds took."""
    record = run.record
    blocks: list[Block] = []
    ledger = record.get("ledger") or {}
    blocks += _ledger(ledger)
    live = not in_lock_step(record)
    took = (
        ("state to result, median", _ms(record.get("state_to_result_ms_p50"))),
        ("state to result, 95 % within", _ms(record.get("state_to_result_ms_p95"))),
    )
    pace = (
        *(took if live else (("pace", "in lock step: the drive waited for each round"),)),
        ("rounds complete too late", str(part_of(record, "futures", "late_rounds") or 0)),
        (
            "rounds with fewer futures than asked",
            str(part_of(record, "futures", "smaller_rounds") or 0),
        ),
        ("processes started again", str(part_of(record, "workers", "restarted") or 0)),
        ("refused: messages, senders", _refused(record)),
    )
    blocks.append(Facts(pace))
    if run.rounds and live:
        columns = ("drive_time_s", "latency_ms", "late")
        time_s, latency, late = (np.array([one[name] for one in run.rounds]) for name in columns)
        rate = part_of(record, "config", "rate_hz")
        period_ms = 1000.0 / rate if rate else None
        blocks.append(
            Plotted(
                latency_plot(time_s, latency, late.astype(bool), period_ms),
                "What each round took from the measured state to its result; the dashed line is "
                "when the next one was due."
                if period_ms
                else "What each round took from the measured state to its result.",
            )
        )
    blocks += [Prose(str(trouble), "bad") for trouble in record.get("troubles") or []]
    blocks += [Prose(str(lost), "bad") for lost in part_of(record, "recovered", "lost") or []]
    if unknown := part_of(record, "recovered", "unknown"):
        blocks.append(
            Prose(f"Not known of this recovered run: {', '.join(map(str, unknown))}.", "watch")
        )
    return Chapter("losses", "Losses and deadlines", tuple(blocks))


def _ledger(ledger: Mapping[str, Any]) -> list[Block]:
    rows = []
    for name, counts in ledger.items():
        for what, count in (counts or {}).items():
            for which, value in count.items() if isinstance(count, dict) else ((what, count),):
                bad = which in ("lost", "given_up", "never_came", "unwritten", "refused") and value
                late = which in ("missed", "spared") and value
                shown = number(
                    None if value is None else float(value),
                    0,
                    tone="bad" if bad else "watch" if late else "",
                )
                rows.append(row(name, which.replace("_", " "), shown))
    if not rows:
        return [Prose("The run's record holds no ledger.", "watch")]
    table = Listed(
        "What became of it",
        ("of", "what", "count"),
        tuple(rows),
        frozenset({2}),
        note="Each round is run, missed, spared (machine too slow), unseeded (nothing to begin "
        "with) or given up; each job has a result, was refused, or is lost.",
    )
    return [table]


def _ms(value: float | None) -> str:
    return "not known" if value is None else f"{value:.0f} ms"


def _refused(record: Mapping[str, Any]) -> str:
    counts = (
        part_of(record, "refused", "count"),
        part_of(record, "refused_by_processes", "count"),
        part_of(record, "refused_by_router", "count"),
    )
    return (
        "not known" if all(one is None for one in counts) else str(sum(one or 0 for one in counts))
    )
