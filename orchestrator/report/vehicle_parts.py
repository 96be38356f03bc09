"""Sections on the vehicle: what the drive says of its parameters, and who departs."""

from __future__ import annotations

from typing import Any

from foretwin.orchestrator.report.blocks import (
    UNKNOWN,
    Chapter,
    Listed,
    Prose,
    TableCell,
    number,
    plural,
    row,
)
from foretwin.orchestrator.report.material import RunMaterial, part_of


def vehicle_part(run: RunMaterial) -> Chapter:
    """Return what the drive says of the vehicle's parameters."""
    title = "Vehicle: identified parameters"
    parameters = part_of(run.record, "tuning", "parameters") or []
    if not parameters:
        text = "Nothing was identified in this drive: tuning was off, or it was too short."
        return Chapter("vehicle", title, (Prose(text),))
    rows = tuple(
        row(
            one["name"],
            _value(one["in_use"]),
            _value(one["identified"]),
            _interval(one),
            _fits(one),
            one.get("reason") or "",
        )
        for one in parameters
    )
    table = Listed(
        "Parameters in use, and what the driving says of them (95 % intervals)",
        ("parameter", "in use", "identified", "interval", "fits", "why not"),
        rows,
        frozenset({1, 2}),
    )
    changes = part_of(run.record, "tuning", "changes") or []
    said = Prose(f"{plural(len(changes), 'change')} of parameters took effect in this drive.")
    return Chapter("vehicle", title, (table, said))


def _value(value: float | None) -> TableCell:
    # Some are a thousandth of others, and decimals alone would show them as 0.
    return number(None) if value is None else TableCell(f"{value:.4g}", order=float(value))


def _interval(one: dict[str, Any]) -> str:
    if one["low"] is None or one["high"] is None:
        return UNKNOWN
    return f"{one['low']:.3g} to {one['high']:.3g}"


def verdict_part(run: RunMaterial) -> Chapter:
    """Return who departs from the commands, with the evidence."""
    title = "Verdicts: who is wrong, vehicle or model"
    found = part_of(run.record, "tuning", "verdicts") or []
    if not found:
        why = (
            "commands were not recorded, so who departs from them cannot be said"
            if part_of(run.record, "tuning", "gap", "independent") is False
            else "nothing showed that the vehicle or the model departs"
        )
        return Chapter("verdicts", title, (Prose(f"Nobody is accused: {why}."),))
    rows = tuple(
        row(
            number(one["drive_time_s"], 1, "s"),
            TableCell(one["culprit"], tone="bad"),
            one["cause"].replace("_", " "),
            one["text"],
            "; ".join(_evidence(shown) for shown in one["evidence"]),
            number(100.0 * one["confidence"], 0, "%"),
        )
        for one in found
    )
    table = Listed(
        "Verdicts, with their evidence",
        ("at", "who", "cause", "what", "evidence", "sure"),
        rows,
        frozenset({0, 5}),
    )
    return Chapter("verdicts", title, (table,))


def _fits(one: dict[str, Any]) -> TableCell:
    if one["departs"]:
        return TableCell("departs", tone="watch")
    return TableCell(UNKNOWN if one["identified"] is None else "fits")


def _evidence(one: dict[str, Any]) -> str:
    name = one["name"].replace("_", " ")
    return f"{name} {one['value']:.3g} ± {one['std']:.2g}, expected {one['expected']:.3g}"
