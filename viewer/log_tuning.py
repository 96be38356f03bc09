"""What the driving says of the vehicle, as rows: the model's gap, verdicts, parameters."""

from __future__ import annotations

import math
from collections import deque
from typing import get_args

import rerun as rr

from foretwin.contracts.gap import (
    ALARM_HORIZON_S,
    GapSample,
    LimitedQuantity,
    Manoeuvre,
    Verdict,
)
from foretwin.contracts.tuning import Identification, ParameterChange, ParameterEstimate
from foretwin.viewer.colours import REAL, TWIN, Colour
from foretwin.viewer.log_drive import LIMIT, PLAN
from foretwin.viewer.rows import Row, document, in_markdown, static

_SHOWN_VERDICTS = 20
"""The newest; all are in the run's table."""
GAPS = {"across_m": 1.0, "along_m": 1.0, "yaw_deg": math.degrees(1.0)}
_FIELDS: dict[str, LimitedQuantity] = {
    "across_m": "across_m",
    "along_m": "along_m",
    "yaw_deg": "yaw_rad",
}
MANOEUVRE_COLOURS: dict[Manoeuvre, Colour] = {
    "standstill": (126, 132, 144),
    "straight": (88, 150, 255),
    "curve": (255, 184, 28),
    "braking": (234, 62, 56),
    "accelerating": (56, 176, 92),
}
PLOTTED = ("steering_ratio", "steering_offset_rad", "steering_delay_s", "drive_gain", "brake_gain")
"""Parameters drawn over time; the table has all."""
_CURVES: dict[str, tuple[Colour, str, float]] = {
    "in_use": (REAL, "in use", 2.0),
    "value": (TWIN, "driving says", 2.0),
    "low": (PLAN, "95 % from", 1.0),
    "high": (PLAN, "95 % to", 1.0),
}
_CULPRITS = {"vehicle": "the real vehicle", "model": "the model", "both": "vehicle and model"}


def static_rows() -> list[Row]:
    """Return names and colours of the curves, and what is said before anything is found."""
    rows = [
        static(
            f"reality/{gap}/{name}",
            rr.SeriesPoints(colors=MANOEUVRE_COLOURS[name], names=name, marker_sizes=3.0),
        )
        for gap in GAPS
        for name in get_args(Manoeuvre)
    ]
    lines = rr.SeriesLines(colors=[LIMIT] * 2, names=["limit", "-limit"], widths=[1.5] * 2)
    rows += [static(f"reality/{gap}/limit", lines) for gap in GAPS]
    for name in PLOTTED:
        for curve, (colour, label, width) in _CURVES.items():
            lines = rr.SeriesLines(colors=colour, names=label, widths=width)
            rows.append(static(f"parameters/{name}/{curve}", lines))
        # Few points, far apart: a line alone would not show the first.
        rows.append(
            static(f"parameters/{name}/taken", rr.SeriesPoints(colors=LIMIT, names="from now on"))
        )
    return rows


class TuningLog:
    """Turns findings into rows; keeps the verdicts of the drive for their text."""

    def __init__(self) -> None:
        self._verdicts: deque[str] = deque(maxlen=_SHOWN_VERDICTS)
        self._estimates: dict[str, ParameterEstimate] = {}

    def opening(self) -> list[Row]:
        """Return the texts before anything is found."""
        return [
            Row("reality/verdict", 0, document("no verdict yet"), True),
            Row("parameters/table", 0, document("nothing identified yet"), True),
        ]

    def gap(self, sample: GapSample, drive_ns: int) -> list[Row]:
        """Return the gap after 2 s by manoeuvre, and the limits beyond which it is an alarm.

        The run's tables hold all horizons.
        """
        if abs(sample.horizon_s - ALARM_HORIZON_S) > 1e-9:
            return []
        rows = []
        for gap, scale in GAPS.items():
            value = scale * getattr(sample, _FIELDS[gap])
            rows.append(Row(f"reality/{gap}/{sample.manoeuvre}", drive_ns, rr.Scalars(value)))
            if sample.independent:
                limit = scale * sample.limits[_FIELDS[gap]]
                rows.append(Row(f"reality/{gap}/limit", drive_ns, rr.Scalars([limit, -limit])))
        return rows

    def verdict(self, verdict: Verdict, drive_ns: int) -> list[Row]:
        """Return all verdicts so far, the newest first, as one text."""
        who = _CULPRITS.get(verdict.culprit, verdict.culprit)
        lines = [
            f"### {drive_ns / 1e9:.1f} s: {in_markdown(who)}, {in_markdown(verdict.cause)}",
            f"{in_markdown(verdict.text)} (confidence {verdict.confidence:.2f})",
            "",
        ]
        lines += [
            f"* {in_markdown(one.name)}: {one.value:.4g} ± {one.std:.2g}, expected "
            f"{one.expected:.4g}. {in_markdown(one.text)}"
            for one in verdict.evidence
        ]
        self._verdicts.appendleft("\n".join(lines))
        return [Row("reality/verdict", drive_ns, document("\n\n".join(self._verdicts)))]

    def identification(self, told: Identification, drive_ns: int) -> list[Row]:
        """Return the table of parameters, and the curves of those that have a value."""
        self._estimates |= {found.name: found for found in told.estimates}
        rows = [Row("parameters/table", drive_ns, document(self._table()))]
        for found in told.estimates:
            if found.name not in PLOTTED:
                continue
            values = {
                "in_use": found.prior,
                "value": found.value,
                "low": found.low,
                "high": found.high,
            }
            rows += [
                Row(f"parameters/{found.name}/{curve}", drive_ns, rr.Scalars(value))
                for curve, value in values.items()
                if value is not None
            ]
        return rows

    def parameter(self, change: ParameterChange, drive_ns: int) -> list[Row]:
        """Return where another value counts from now on."""
        if change.name not in PLOTTED:
            return []
        path = f"parameters/{change.name}"
        return [
            Row(f"{path}/in_use", max(0, drive_ns - 1), rr.Scalars(change.before)),
            Row(f"{path}/in_use", drive_ns, rr.Scalars(change.value)),
            Row(f"{path}/taken", drive_ns, rr.Scalars(change.value)),
        ]

    def _table(self) -> str:
        lines = ["| parameter | in use | driving says | 95 % | |", "|---|---|---|---|---|"]
        for found in self._estimates.values():
            interval = "" if found.low is None else f"{_number(found.low)} to {_number(found.high)}"
            cells = (found.name, _number(found.prior), _number(found.value), interval, found.reason)
            lines.append("| " + " | ".join(in_markdown(cell) for cell in cells) + " |")
        return "\n".join(lines)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
