"""Which column is the rows' time, in what unit, from what zero."""

from __future__ import annotations

import datetime
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import TimeBase
from foretwin.telemetry.logs.declare.loose_table import LooseTable
from foretwin.telemetry.logs.units import ISO_TIME, TIME_NS

_RISES, _LEAST_RISES = 0.97, 0.15
"""So many steps of a clock are forwards; fewer where rows of several sensors share a stamp."""
_STEP_S = (2e-4, 15.0)
"""Rows come so fast, in the middle."""
_UTC_S = (946_684_800.0, 4e9)
"""1970's seconds of 2000 and 2096: what lies between is taken for UTC."""
_LEAST_S = 3.0


class ClockColumn(NamedTuple):
    """A column read as time: seconds (N,) since its first, NaN where there is none."""

    column: str
    unit: str
    base: TimeBase
    time_s: Array
    counts: bool
    """It grows by one from row to row: as likely a number of the row."""
    evidence: str


def clocks_of(table: LooseTable) -> list[ClockColumn]:
    """Return what may be the rows' time, the likeliest first.

    Dates, then seconds since 1970, then what rises unevenly or in parts of a unit, what stands for
    rows, last what counts by one. Units that fit are told apart by speeds, as places are found.
    """
    found = []
    for name, stamps_ns in table.times.items():
        known = stamps_ns > np.iinfo(np.int64).min
        first_ns = stamps_ns[known][0]
        time_s = np.where(known, (stamps_ns - first_ns) * 1e-9, np.nan)
        rises = _rises(time_s)
        if rises >= _LEAST_RISES:
            said = f"dates from {_day(first_ns)}"
            clock = ClockColumn(name, ISO_TIME, "utc", time_s, False, said)
            found.append((2.0 * (rises < _RISES), clock))
    for name, values in table.columns.items():
        rises = _rises(values)
        if rises < _LEAST_RISES:
            continue
        numbers = values[np.isfinite(values)]
        step = float(np.median(np.diff(numbers)[np.diff(numbers) > 0.0]))
        for unit, factor in TIME_NS.items():
            scale = float(factor) * 1e-9
            if not _STEP_S[0] <= step * scale <= _STEP_S[1]:
                continue
            time_s = (values - numbers[0]) * scale
            if time_s[np.isfinite(time_s)].max() < _LEAST_S:
                continue
            counts = bool(np.all(np.diff(numbers) == 1.0))
            first_s = numbers[0] * scale
            utc = _UTC_S[0] < first_s < _UTC_S[1]
            base: TimeBase = "utc" if utc else "log" if abs(first_s) < 1.0 else "boot"
            said = _said(base, first_s)
            # A clock that stands for rows is another's, repeated; one by one it may be a counter.
            rank = (0.0 if utc else 1.0) + 2.0 * counts + 2.0 * (rises < _RISES)
            found.append((rank, ClockColumn(name, unit, base, time_s, counts, said)))
    return [clock for _, clock in sorted(found, key=lambda one: one[0])]


def _said(base: TimeBase, first_s: float) -> str:
    """Return in words where a clock's zero lies."""
    if base == "utc":
        day = _day(round(first_s * 1e9))
        return (
            f"seconds since 1970 from {day}"
            " (GPS time would lie 10 years on: no table tells it from UTC)"
        )
    if base == "log":
        return "from zero"
    return f"from {first_s:.3f} s: since some start, as data tell"


def _rises(values: Array) -> float:
    """Return the share of steps forwards, 0 where one in fifty goes back or few are known."""
    known = values[np.isfinite(values)]
    if len(known) < 0.9 * len(values) or len(known) < 3:
        return 0.0
    steps = np.diff(known)
    return float(np.mean(steps > 0.0)) if np.mean(steps < 0.0) < 0.02 else 0.0


def _day(stamp_ns: int) -> str:
    moment = datetime.datetime.fromtimestamp(stamp_ns * 1e-9, tz=datetime.UTC)
    return moment.strftime("%Y-%m-%d %H:%M:%S")
