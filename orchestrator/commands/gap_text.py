"""The reality gap as text of 80 columns: tables, verdicts with their evidence."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from foretwin.contracts.gap import GapAlarm, Verdict
from foretwin.sim_worker.analysis.gap.errors import GapRow

WIDTH = 80
_DEGREES = 57.29578
_COLUMNS = (
    ("position_m", "place", "m", 1.0),
    ("along_m", "along", "m", 1.0),
    ("across_m", "across", "m", 1.0),
    ("yaw_rad", "head.", "°", _DEGREES),
    ("yaw_rate_radps", "rate", "°/s", _DEGREES),
    ("speed_mps", "speed", "m/s", 1.0),
    ("accel_mps2", "accel", "m/s²", 1.0),
)


def table_lines(rows: Sequence[GapRow]) -> Iterator[str]:
    """Yield one table of RMS and one of 95th percentiles: a line for each horizon and manoeuvre."""
    first = f"{'after':>5} {'manoeuvre':<12} {'runs':>5}"
    for title, named in (
        ("RMS of the gap, the model left to itself", "rms"),
        ("95 % of its gaps are below", "p95"),
    ):
        yield title
        yield first + "".join(f"{label:>8}" for _, label, _, _ in _COLUMNS)
        yield " " * len(first) + "".join(f"{unit:>8}" for _, _, unit, _ in _COLUMNS)
        for row in rows:
            values = row.rms if named == "rms" else row.p95
            cells = "".join(f"{scale * values[name]:>8.2f}" for name, _, _, scale in _COLUMNS)
            yield f"{row.horizon_s:>3g} s {row.manoeuvre:<12} {row.runs:>5}{cells}"
        yield ""


def why_undecided(verdicts: Sequence[Verdict], *, commanded: bool) -> str | None:
    """Return why nobody is accused, None where somebody is."""
    if any(verdict.culprit != "undecided" for verdict in verdicts):
        return None
    if not commanded:
        return (
            "commands were not recorded: the gap is that of commands estimated from the motion "
            "itself, and who departs from them cannot be said"
        )
    if verdicts:
        return verdicts[-1].text
    return "nothing shows that the car or the model departs"


def verdict_lines(
    verdicts: Sequence[Verdict], alarms: Sequence[GapAlarm], *, start_ns: int, commanded: bool
) -> Iterator[str]:
    """Yield what is said of alarms and verdicts, with times since the drive's start."""
    raised = [alarm for alarm in alarms if alarm.over]
    kinds = ", ".join(dict.fromkeys(alarm.quantity for alarm in raised))
    yield f"alarms: {len(raised)}{f' ({kinds})' if kinds else ''}"
    reason = why_undecided(verdicts, commanded=commanded)
    if reason is not None and not (commanded and verdicts):
        yield from _wrapped(f"verdict: none: {reason}" if commanded else reason)
    for verdict in verdicts:
        who = {"vehicle": "real vehicle", "model": "vehicle model"}.get(
            verdict.culprit, verdict.culprit
        )
        at_s, since_s = (
            (ns - start_ns) * 1e-9 for ns in (verdict.stamp_ns, verdict.since_stamp_ns)
        )
        when = f"verdict at {at_s:.1f} s, since {since_s:.1f} s"
        yield f"{when}: {who}, {verdict.cause} (sure {verdict.confidence:.0%})"
        yield from _wrapped(verdict.text, indent="  ")
        for one in verdict.evidence:
            text = f"{one.name} {one.value:.4g} ± {one.std:.2g}, expected {one.expected:.4g}"
            yield from _wrapped(f"{text}: {one.text}", indent="  - ")


def _wrapped(text: str, *, indent: str = "") -> list[str]:
    then = " " * len(indent)
    wrapper = textwrap.TextWrapper(WIDTH, indent, then, break_long_words=False)
    return wrapper.wrap(text)
