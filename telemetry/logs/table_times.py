"""Times as tables write them: numbers in a unit, days, dates in any order, times of the day.

A time of the day that tells no date counts from midnight before the first row; one that falls by
half a day or more begins the next day, and one of just before midnight that comes after it is of
the day before. Dates without a zone are UTC.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Sequence
from decimal import Decimal, InvalidOperation

from foretwin.telemetry.logs import units
from foretwin.telemetry.logs.gpx import representable_ns, stamp_ns_from_iso
from foretwin.telemetry.logs.merge import LATE_NS

DATES = {"ymd": (0, 1, 2), "dmy": (2, 1, 0), "mdy": (2, 0, 1)}
"""Where year, month and day stand in a date of such a unit."""
CLOCK, HHMMSS = "clock", "hhmmss"
"""Times of the day: hh:mm:ss, and digits without anything between."""
DAYS = {"days1900": 25_569, "datenum": 719_529}
"""Days: as spreadsheets count them, and as MATLAB does; with what 1970-01-01 is."""
DATE_UNITS = (units.ISO_TIME, *DATES)
TEXTS = (*DATE_UNITS, CLOCK)
UNITS = (*units.TIME_NS, *TEXTS, HHMMSS, *DAYS)
"""What the unit of a time may be."""

StampOf = Callable[[str], int | None]

DAY_NS = 86_400 * 10**9
_ZONE = r"(Z|UTC|GMT|[+-]\d{2}:?\d{2})"
_DATE = re.compile(r"(\d{1,4})([./-])(\d{1,2})\2(\d{1,4})(?:[T ,;]+(.+))?")
_NAMED = re.compile(r"(\d{1,2})[./ -]+([^\W\d_]{3,9})[./ -]+(\d{2}|\d{4})(?![^T ,;])")
_MONTHS = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_IN_GERMAN = {"mär": "mar", "mrz": "mar", "mai": "may", "okt": "oct", "dez": "dec"}
"""How names of months begin."""
_TIME = re.compile(
    r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,:](\d{1,9}))?\s*([AaPp])?(?:\.?[Mm]\.?)?"
    rf"\s*{_ZONE}?"
)
_EPOCH = datetime.date(1970, 1, 1)


def stamp_reader(unit: str, decimal: str = ".") -> StampOf:
    """Return what turns a cell into ns, since 1970 or since midnight; None of what is no time."""
    if unit == units.ISO_TIME:
        return lambda text: stamp_ns_from_iso(text.strip())
    if unit == "dmy":
        return lambda text: _date_ns(_NAMED.sub(_with_number, text.strip(), 1), DATES[unit])
    if unit in DATES:
        return lambda text: _date_ns(text.strip(), DATES[unit])
    if unit == CLOCK:
        return lambda text: _time_ns(text.strip())
    if unit == HHMMSS:
        return lambda text: _digits_ns(text.strip().replace(decimal, "."))
    if unit in DAYS:
        return _number_reader(Decimal(DAY_NS), Decimal(DAYS[unit]), decimal)
    return _number_reader(units.TIME_NS[unit], Decimal(0), decimal)


def is_of_day(unit: str) -> bool:
    """Tell whether times in a unit begin anew at midnight."""
    return unit in (CLOCK, HHMMSS)


def days_counted(stamps_ns: Sequence[int | None]) -> list[int | None]:
    """Return times of the day as they go on over midnights."""
    day_ns, latest_ns = 0, None
    found: list[int | None] = []
    for stamp_ns in stamps_ns:
        if stamp_ns is not None:
            day_ns += DAY_NS * days_on(stamp_ns, stamp_ns if latest_ns is None else latest_ns)
            latest_ns, stamp_ns = stamp_ns, stamp_ns + day_ns
        found.append(stamp_ns)
    return found


def days_on(time_ns: int, before_ns: int) -> int:
    """Return by how many days a time of the day is beyond the one before: 1 where it falls by half
    a day or more and begins the next, -1 where it is of before midnight and comes late."""
    if time_ns - before_ns > DAY_NS - LATE_NS:
        return -1
    return int(before_ns - time_ns > DAY_NS // 2)


def tells_zone(text: str) -> bool:
    """Tell whether a date and time name their zone."""
    return re.search(rf"{_ZONE}$", text.strip()) is not None


def _number_reader(factor: Decimal, zero: Decimal, decimal: str) -> StampOf:
    def read(text: str) -> int | None:
        try:
            number = Decimal(text.strip().replace(decimal, ".")) - zero
            return representable_ns(int((number * factor).to_integral_value()))
        except (InvalidOperation, ValueError, OverflowError):
            return None

    return read


def _date_ns(text: str, order: tuple[int, int, int]) -> int | None:
    match = _DATE.fullmatch(text)
    if match is None:
        return None
    parts = (match[1], match[3], match[4])
    year, month, day = (int(parts[place]) for place in order)
    if len(parts[order[0]]) not in (2, 4):
        return None
    try:
        date = datetime.date(year + 2000 if len(parts[order[0]]) == 2 else year, month, day)
    except ValueError:
        return None
    of_day_ns = 0 if match[5] is None else _time_ns(match[5].strip())
    if of_day_ns is None:
        return None
    return representable_ns((date - _EPOCH).days * DAY_NS + of_day_ns)


def _with_number(date: re.Match[str]) -> str:
    """Return a date whose month is named, with that month's number; 0 where it is none."""
    begins = date[2][:3].lower()
    begins = _IN_GERMAN.get(begins, begins)
    return f"{date[1]}.{_MONTHS.index(begins) + 1 if begins in _MONTHS else 0}.{date[3]}"


def _time_ns(text: str) -> int | None:
    match = _TIME.fullmatch(text)
    if match is None:
        return None
    hours, minutes, seconds = (int(match[number]) for number in (1, 2, 3))
    if match[5] is not None:
        if not 1 <= hours <= 12:
            return None
        hours = hours % 12 + (12 if match[5] in "pP" else 0)
    if hours > 23 or minutes > 59 or seconds > 60:
        return None
    of_day_ns = ((hours * 60 + minutes) * 60 + seconds) * 10**9
    of_day_ns += int((match[4] or "").ljust(9, "0"))
    return of_day_ns - _zone_ns(match[6] or "Z")


def _zone_ns(text: str) -> int:
    if text[0] not in "+-":
        return 0
    minutes = int(text[1:3]) * 60 + int(text[-2:])
    return (-1 if text[0] == "-" else 1) * minutes * 60 * 10**9


def _digits_ns(text: str) -> int | None:
    whole, _, fraction = text.partition(".")
    if not (whole + fraction).isdecimal() or len(whole) > 6:
        return None
    whole = whole.rjust(6, "0")
    return _time_ns(f"{whole[:2]}:{whole[2:4]}:{whole[4:]}.{fraction[:9] or '0'}")
