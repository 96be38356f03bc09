"""Sentences of NMEA-0183 out of lines of text, and the times, dates and angles in their fields."""

from __future__ import annotations

import datetime
import functools
import math
import operator
import re
from typing import NamedTuple

from foretwin.contracts.frames import wrap_angle
from foretwin.telemetry.logs.table_times import DAY_NS

CHECKSUM_WRONG = "checksum wrong"
_SENTENCE = re.compile(r"\$([A-Z]{2}|P[A-Z]*)(RMC|GGA|VTG|HDT|ZDA),([^*\r\n$]*)(?:\*(\w*))?")
_ANY = re.compile(r"\$([A-Z]{2}[A-Z]{3},[^*$]*)\*([0-9A-Fa-f]{2})")

Fields = list[str]


class Sentence(NamedTuple):
    """One sentence: its formatter such as RMC, and the fields after it."""

    formatter: str
    fields: Fields


def sentence_of(line: str) -> Sentence | str | None:
    """Return the sentence of a line, why it is refused, or None for other sentences and texts."""
    # The last `$`: where a receiver was cut off, the next sentence begins within the line.
    start = line.rfind("$")
    match = _SENTENCE.match(line, start) if start >= 0 else None
    if match is None:
        return None
    _, formatter, body, checksum = match.groups()
    if checksum is not None and checksum.upper() != _checksum(
        line[start + 1 : line.index("*", start)]
    ):
        return CHECKSUM_WRONG
    return Sentence(formatter, body.split(","))


def is_any_sentence(line: str) -> bool:
    """Tell whether a line holds a sentence of any formatter whose checksum is right."""
    match = _ANY.search(line)
    return match is not None and match[2].upper() == _checksum(match[1])


def _checksum(between: str) -> str:
    return f"{functools.reduce(operator.xor, between.encode('utf-8', 'replace'), 0):02X}"


def time_of_day_ns(sentence: Sentence) -> int | None:
    """Return the time of day, None where none is told; raises ValueError for a wrong one."""
    if sentence.formatter not in ("RMC", "GGA", "ZDA") or not sentence.fields[0]:
        return None
    text = sentence.fields[0]
    whole, _, fraction = text.partition(".")
    if len(whole) != 6 or not (whole + fraction).isdecimal():
        raise ValueError(f"time {text!r}")
    hours, minutes, seconds = int(whole[:2]), int(whole[2:4]), int(whole[4:])
    if hours > 23 or minutes > 59 or seconds > 60:
        raise ValueError(f"time {text!r}")
    return ((hours * 60 + minutes) * 60 + seconds) * 10**9 + int(fraction[:9].ljust(9, "0"))


def date_of(sentence: Sentence) -> datetime.date | None:
    """Return an RMC's or ZDA's date, None where none is told; raises ValueError for a wrong one."""
    fields = sentence.fields
    if sentence.formatter == "RMC" and len(fields) > 8 and len(fields[8]) == 6:
        day, month, year = int(fields[8][:2]), int(fields[8][2:4]), int(fields[8][4:])
        # GPS began in 1980: two digits from 80 on are of that century.
        return datetime.date(year + (1900 if year >= 80 else 2000), month, day)
    if sentence.formatter == "ZDA" and len(fields) > 3 and fields[3]:
        return datetime.date(int(fields[3]), int(fields[2]), int(fields[1]))
    return None


def midnight_ns(date: datetime.date) -> int:
    """Return ns since 1970 of the beginning of a day in UTC."""
    return (date - datetime.date(1970, 1, 1)).days * DAY_NS


def degrees_of(value: str, half: str, negative: str, positive: str) -> float:
    """Return degrees of `dddmm.mmm` and its hemisphere; raises ValueError for what is none."""
    point = value.find(".")
    minutes_at = (len(value) if point < 0 else point) - 2
    if minutes_at < 1 or half not in (negative, positive):
        raise ValueError(f"angle {value!r} {half!r}")
    minutes = float(value[minutes_at:])
    if not 0.0 <= minutes < 60.0:
        raise ValueError(f"angle {value!r}")
    degrees = int(value[:minutes_at]) + minutes / 60.0
    return -degrees if half == negative else degrees


def yaw_rad_of(clockwise_deg: float) -> float:
    """Return yaw counter-clockwise from east of degrees clockwise from north."""
    return float(wrap_angle(math.radians(90.0 - clockwise_deg)))
