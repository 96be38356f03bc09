"""The section of several runs that says what happened over all of them, by kilometre and hour."""

from __future__ import annotations

from foretwin.orchestrator.report.blocks import (
    Block,
    Chapter,
    Listed,
    Prose,
    TableCell,
    number,
    plural,
    row,
)
from foretwin.orchestrator.report.indicator_statistics import LEAST_DRIVES
from foretwin.orchestrator.report.indicators import DriveIndicators, ExposureUnit, Indicator

SOURCE = (
    "In the manner of the safety performance indicators of ANSI/UL 4600. The standard was not "
    "read; what an indicator is, a metric from evidence with a threshold that conditions a claim, "
    "is as Koopman and Kane have it (Safe Autonomy, June 2021). Thresholds on these rates are not "
    "set here: they belong to a safety case."
)
_UNITS: dict[ExposureUnit, tuple[float, str, str]] = {
    "km": (100.0, "per 100 km", "km"),
    "h": (1.0, "per hour", "h"),
    "pass": (100.0, "per 100 passed", "passed"),
    "trial": (100.0, "%", ""),
}
"""By what a value is multiplied for people, how that is called, and the unit of exposure."""


def indicators_part(found: DriveIndicators) -> Chapter:
    """Return the section of indicators over several drives."""
    blocks: list[Block] = [Prose(SOURCE, "quiet")]
    if found.replays:
        blocks.append(
            Prose(
                f"{plural(found.replays, 'drive')} replay a recording that another one replays as "
                "well: what happened in it is counted again, and intervals are too narrow.",
                "watch",
            )
        )
    blocks.append(Prose(_on_trend(found)))
    if found.indicators:
        columns = (
            "what",
            "events",
            "of",
            "unit",
            "in drives",
            "rate",
            "95 % from",
            "to",
            "later half",
        )
        blocks.append(
            Listed(
                f"Over {plural(found.drives, 'drive')}",
                columns,
                tuple(_row(one) for one in found.indicators),
                frozenset({1, 2, 4, 5, 6, 7}),
                note="Exact intervals: Garwood of rates, Clopper and Pearson of shares. They take "
                "events as independent; what comes in bursts is less certain. A drive that cannot "
                "tell, as one whose car told of no road users cannot of conflicts, adds no "
                "exposure.",
            )
        )
    if (covered := found.calibration).coverage is not None:
        blocks.append(
            Prose(
                f"{100.0 * covered.coverage:.1f} % of {plural(covered.forecasts, 'forecast')} in "
                f"{plural(covered.drives, 'drive')} came between p10 and p90, where 80 % is right. "
                "Forecasts overlap in time, so no interval is given."
            )
        )
    return Chapter("indicators", "Indicators over these drives", tuple(blocks))


def _on_trend(found: DriveIndicators) -> str:
    if not found.in_order:
        return "Some ids of runs do not tell when they began, so no trend is told."
    if found.drives < LEAST_DRIVES:
        return f"A trend is told of {LEAST_DRIVES} drives or more."
    changed = [one for one in found.indicators if one.trend is not None]
    if not changed:
        return (
            "Between the earlier and the later half of drives nothing differs significantly "
            "(Holm over all rows, 5 %)."
        )
    return (
        f"{plural(len(changed), 'row differs', 'rows differ')} significantly between the earlier "
        "and the later half of drives (Holm over all rows, 5 %)."
    )


def _row(one: Indicator) -> tuple[TableCell, ...]:
    times, per, unit = _UNITS[one.unit]
    digits = 0 if one.unit in ("pass", "trial") else 2
    at = f", {one.junction_kind.replace('_', ' ')}" if one.junction_kind else ""
    scaled = (None if v is None else times * v for v in (one.value, one.low, one.high))
    trend = "" if one.trend is None else f"{one.trend} (p {one.p_value:.2g})"
    return row(
        f"{one.name}{at}",
        number(float(one.events), 0),
        number(one.exposure, digits, unit),
        per,
        number(float(one.drives), 0),
        *(number(value, 2) for value in scaled),
        TableCell(trend, tone="watch" if one.trend == "more" else ""),
    )
