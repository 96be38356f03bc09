"""Which column is the rows' time, in what unit, from what zero."""

from __future__ import annotations

import datetime
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import TimeBase
from foretwin.telemetry.logs.declare.loose_table import LooseTable, TimeTexts
from foretwin.telemetry.logs.table_times import CLOCK, DAYS, HHMMSS
from foretwin.telemetry.logs.units import TIME_NS

_RISES, _LEAST_RISES = 0.97, 0.15
"""So many steps of a clock are forwards; fewer where rows of several sensors share a stamp."""
_STEP_S = (2e-4, 15.0)
"""Rows come so fast, in the middle."""
_UTC_S = (946_684_800.0, 4e9)
"""1970's seconds of 2000 and 2096: what lies between is taken for UTC."""
_LEAST_S = 3.0
_SKIPPED = 40.0
"""From 59 s to the next minute digits grow by 41."""


class ClockColumn(NamedTuple):
    """A column read as time: seconds (N,) since its first, NaN where there is none."""

    column: str
    unit: str
    base: TimeBase
    time_s: Array
    counts: bool
    """It grows by one from row to row: as likely a number of the row."""
    evidence: str
    date: str | None = None
    """Another column, of its days."""


def clocks_of(table: LooseTable) -> list[ClockColumn]:
    """Return what may be the rows' time, the likeliest first.

    Dates, then seconds since 1970, then what rises unevenly or in parts of a unit, what stands for
    rows, last what counts by one. Units that fit are told apart by speeds, as places are found.
    """
    found = []
    for name, told in table.times.items():
        known = told.stamps_ns > np.iinfo(np.int64).min
        first_ns = told.stamps_ns[known][0]
        time_s = np.where(known, (told.stamps_ns - first_ns) * 1e-9, np.nan)
        rises = _rises(time_s)
        if rises >= _LEAST_RISES:
            day: TimeBase = "boot" if told.unit == CLOCK else "utc"
            clock = ClockColumn(name, told.unit, day, time_s, False, _dates_said(told, first_ns))
            found.append((2.0 * (rises < _RISES), clock._replace(date=told.date)))
    for name, values in table.columns.items():
        rises = _rises(values)
        if rises >= _LEAST_RISES:
            found += [(rank + 2.0 * (rises < _RISES), one) for rank, one in _numbered(name, values)]
    return [clock for _, clock in sorted(found, key=lambda one: one[0])]


def _numbered(name: str, values: Array) -> list[tuple[float, ClockColumn]]:
    """Return a rising column of numbers as a clock in each unit that its steps allow, ranked."""
    numbers = values[np.isfinite(values)]
    step = float(np.median(np.diff(numbers)[np.diff(numbers) > 0.0]))
    if (digits := _of_digits(name, values)) is not None:
        return [(1.0, digits)]
    found = []
    scales = {unit: (float(factor) * 1e-9, 0.0) for unit, factor in TIME_NS.items()}
    scales |= {unit: (86_400.0, float(zero)) for unit, zero in DAYS.items()}
    for unit, (scale, zero) in scales.items():
        if not _STEP_S[0] <= step * scale <= _STEP_S[1]:
            continue
        time_s = (values - numbers[0]) * scale
        if time_s[np.isfinite(time_s)].max() < _LEAST_S:
            continue
        first_s = (numbers[0] - zero) * scale
        utc = _UTC_S[0] < first_s < _UTC_S[1]
        # Nobody counts rows from a billion: so begins a logger's second after second.
        counts = not utc and bool(np.all(np.diff(numbers) == 1.0))
        if unit in DAYS and not utc:
            continue
        base: TimeBase = "utc" if utc else "log" if abs(first_s) < 1.0 else "boot"
        said = _said(base, first_s)
        # A clock that stands for rows is another's, repeated; one by one it may be a counter.
        rank = (0.0 if utc else 1.0) + 2.0 * counts
        found.append((rank, ClockColumn(name, unit, base, time_s, counts, said)))
    return found


def _of_digits(name: str, values: Array) -> ClockColumn | None:
    """Return a column as times of day in digits, hhmmss, where it skips from 59 s to the minute."""
    whole = np.floor(values[np.isfinite(values)])
    steps = np.diff(whole)
    if not (whole.min() >= 0.0 and whole.max() < 240_000.0 and np.any(steps >= _SKIPPED)):
        return None
    if np.any(whole % 100.0 >= 60.0) or np.any(whole // 100.0 % 100.0 >= 60.0):
        return None
    of_day_s = values // 10_000.0 * 3600.0 + values // 100.0 % 100.0 * 60.0 + values % 100.0
    time_s = of_day_s - of_day_s[np.isfinite(of_day_s)][0]
    time_s = time_s + 86_400.0 * (time_s < -43_200.0)
    said = "times of day in digits, hhmmss: none has more than 59 s"
    return ClockColumn(name, HHMMSS, "boot", time_s, False, said)


def _dates_said(told: TimeTexts, first_ns: int) -> str:
    """Return in words what texts of time say, and what they leave open."""
    if told.unit == CLOCK:
        return "times of day, of no date: since midnight before the first row"
    said = f"dates from {_day(first_ns)}"
    if told.either:
        first = "month" if told.unit == "mdy" else "day"
        said += f", the {first} first by usage alone"
    return said if told.zone else f"{said}; no zone told: taken for UTC"


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
