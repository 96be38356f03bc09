"""Reader of NMEA-0183 logs: RMC, GGA, VTG, HDT and ZDA of any talker, one sentence per line.

Positions are GGA's where the file has any, else RMC's; altitude is made ellipsoidal with GGA's
geoid separation, and the standard deviation is what GGA's quality and HDOP promise. Speed is RMC's
in knots, else VTG's. Yaw is HDT's heading; without any HDT it is RMC's course over ground above
MIN_COURSE_MPS. Degrees are clockwise from true north. Dates are RMC's or ZDA's; where only times
are told, one that falls by half a day or more begins the next day.
Sentences without a time (VTG, HDT) get that of the sentence before. Lines may have something before
the `$`; a wrong checksum is counted, a missing one is let pass.
"""

from __future__ import annotations

import datetime
import functools
import math
import operator
import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, wrap_angle
from foretwin.telemetry.logs import units
from foretwin.telemetry.logs.log import UNREADABLE_ROW, Log, LogError, Sample
from foretwin.telemetry.logs.merge import reordered
from foretwin.telemetry.ros_messages.foreign import NO_FIX

CHECKSUM_WRONG = "checksum wrong"
NO_TIME = "sentence before any time"
MIN_COURSE_MPS = 2.0
"""A course over ground means nothing at a standstill."""
_DAY_NS = 86_400 * 10**9
_WINDOW_NS = 2_000_000_000
_SENTENCE = re.compile(r"\$([A-Z]{2}|P[A-Z]*)(RMC|GGA|VTG|HDT|ZDA),([^*\r\n$]*)(?:\*(\w*))?")
_STD_M = {"1": 2.1, "2": 1.7, "3": 2.1, "4": 0.015, "5": 0.3, "9": 1.7}
"""One standard deviation on each axis at an HDOP of 1, by GGA's quality: 2.5 m CEP alone and 2 m
with SBAS (u-blox NEO-M8 data sheet, over 1.177), 1 cm + 1 ppm CEP with RTK (ZED-F9P data sheet);
floating RTK is chosen."""
_LEAST_HDOP = 0.5
_MODES_WITHOUT_FIX = ("N", "E", "M", "S")
"""Mode indicators: not valid, estimated, manual, simulator."""


Fields = list[str]
Skipped = Counter[str]


class Sentence(NamedTuple):
    """One sentence: its formatter such as RMC, and the fields after it."""

    formatter: str
    fields: Fields


class _Found(NamedTuple):
    """What a file holds, which decides what is taken from where."""

    formatters: frozenset[str]
    first_date: datetime.date
    first_time_ns: int


def is_nmea(text: str) -> bool:
    """Tell whether a text begins like an NMEA-0183 log."""
    lines = text.splitlines()[:20]
    return any(_SENTENCE.search(line) for line in lines) and not text.startswith(("<", "{"))


def sentence_of(line: str) -> Sentence | str | None:
    """Return the sentence of a line, why it is refused, or None for other sentences and texts."""
    # The last `$`: where a receiver was cut off, the next sentence begins within the line.
    start = line.rfind("$")
    match = _SENTENCE.match(line, start) if start >= 0 else None
    if match is None:
        return None
    _, formatter, body, checksum = match.groups()
    if checksum is not None:
        between = line[start + 1 : line.index("*", start)]
        summed = functools.reduce(operator.xor, between.encode("utf-8", "replace"), 0)
        if checksum.upper() != f"{summed:02X}":
            return CHECKSUM_WRONG
    return Sentence(formatter, body.split(","))


def open_nmea(path: Path) -> Log:
    """Open an NMEA-0183 log; raises LogError where it tells no date or no position."""
    found = _survey(path)
    samples = list(_samples(path, found, Counter()))
    if not any(channel == "gnss" for channel, _ in samples):
        raise LogError(f"{path}: no RMC or GGA sentence with a fix, so no positions")
    stamps = [message.stamp_ns for _, message in samples]  # type: ignore[attr-defined]
    return Log(
        info=drive.VehicleInfo(
            vehicle_id="car",
            time_base="utc",
            start_stamp_ns=min(stamps),
            end_stamp_ns=max(stamps),
            source=path.name,
            reference_point="antenna",
            sends=tuple(dict.fromkeys(channel for channel, _ in samples)),
        ),
        read=lambda skipped: reordered(_samples(path, found, skipped), window_ns=_WINDOW_NS),
    )


def _lines(path: Path) -> Iterator[str]:
    with path.open(encoding="utf-8-sig", errors="replace") as text:
        yield from text


def _survey(path: Path) -> _Found:
    formatters, first = set(), None
    first_time_ns: int | None = None
    for line in _lines(path):
        sentence = sentence_of(line)
        if not isinstance(sentence, Sentence):
            continue
        formatters.add(sentence.formatter)
        try:
            time_ns, date = _time_ns(sentence), _date(sentence)
        except (ValueError, IndexError):  # counted when it is read
            continue
        first_time_ns = time_ns if first_time_ns is None else first_time_ns
        if first is None and date is not None and time_ns is not None and first_time_ns is not None:
            # What came before the first date may be of the day before.
            late = first_time_ns - time_ns > _DAY_NS // 2
            first = date - datetime.timedelta(days=1) if late else date
    if first is None or first_time_ns is None:
        raise LogError(f"{path}: no RMC or ZDA sentence with a date, so no times")
    return _Found(frozenset(formatters), first, first_time_ns)


def _samples(path: Path, found: _Found, skipped: Counter[str]) -> Iterator[Sample]:
    date, latest_ns, stamp_ns = found.first_date, found.first_time_ns, None
    for line in _lines(path):
        sentence = sentence_of(line)
        if sentence is None:
            continue
        if isinstance(sentence, str):
            skipped[sentence] += 1
            continue
        try:
            time_ns = _time_ns(sentence)
            if time_ns is not None:
                if (stated := _date(sentence)) is not None:
                    date = stated
                elif latest_ns - time_ns > _DAY_NS // 2:
                    date += datetime.timedelta(days=1)
                latest_ns = time_ns
                stamp_ns = _midnight_ns(date) + time_ns
            if stamp_ns is None:
                skipped[NO_TIME] += 1
                continue
            yield from _READERS[sentence.formatter](sentence.fields, stamp_ns, found, skipped)
        except (ValueError, IndexError, OverflowError):
            skipped[UNREADABLE_ROW] += 1


def _midnight_ns(date: datetime.date) -> int:
    return (date - datetime.date(1970, 1, 1)).days * _DAY_NS


def _time_ns(sentence: Sentence) -> int | None:
    """Return the time of day, None where the sentence tells none."""
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


def _date(sentence: Sentence) -> datetime.date | None:
    fields = sentence.fields
    if sentence.formatter == "RMC" and len(fields) > 8 and len(fields[8]) == 6:
        day, month, year = int(fields[8][:2]), int(fields[8][2:4]), int(fields[8][4:])
        # GPS began in 1980: two digits from 80 on are of that century.
        return datetime.date(year + (1900 if year >= 80 else 2000), month, day)
    if sentence.formatter == "ZDA" and len(fields) > 3 and fields[3]:
        return datetime.date(int(fields[3]), int(fields[2]), int(fields[1]))
    return None


def _degrees(value: str, half: str, negative: str, positive: str) -> float:
    """Return degrees of `dddmm.mmm` and its hemisphere."""
    point = value.find(".")
    minutes_at = (len(value) if point < 0 else point) - 2
    if minutes_at < 1 or half not in (negative, positive):
        raise ValueError(f"angle {value!r} {half!r}")
    minutes = float(value[minutes_at:])
    if not 0.0 <= minutes < 60.0:
        raise ValueError(f"angle {value!r}")
    degrees = int(value[:minutes_at]) + minutes / 60.0
    return -degrees if half == negative else degrees


def _yaw_rad(clockwise_deg: str) -> float:
    return float(wrap_angle(math.radians(90.0 - float(clockwise_deg))))


def _rmc(fields: Fields, stamp_ns: int, found: _Found, skipped: Skipped) -> Iterator[Sample]:
    mode = fields[11] if len(fields) > 11 else ""
    if fields[1] != "A" or mode in _MODES_WITHOUT_FIX:
        skipped[NO_FIX] += 1
        return
    if "GGA" not in found.formatters:
        position = GeoPoint(
            _degrees(fields[2], fields[3], "S", "N"), _degrees(fields[4], fields[5], "W", "E")
        )
        yield "gnss", drive.GnssFix(stamp_ns=stamp_ns, position=position)
    if fields[6]:
        yield from _velocity(stamp_ns, float(fields[6]) * units.SPEED["kn"], fields[7], found)


def _gga(fields: Fields, stamp_ns: int, _found: _Found, skipped: Skipped) -> Iterator[Sample]:
    quality = fields[5]
    # 6 estimated, 7 manual, 8 simulator: none of them was measured.
    if quality not in ("1", "2", "3", "4", "5", "9"):
        skipped[NO_FIX] += 1
        return
    height_m = float(fields[8]) if fields[8] else 0.0
    separation_m = float(fields[10]) if len(fields) > 10 and fields[10] else 0.0
    position = GeoPoint(
        _degrees(fields[1], fields[2], "S", "N"),
        _degrees(fields[3], fields[4], "W", "E"),
        height_m + separation_m,
    )
    std_m = _STD_M[quality] * max(float(fields[7]) if fields[7] else 1.0, _LEAST_HDOP)
    yield "gnss", drive.GnssFix(stamp_ns=stamp_ns, position=position, std_m=std_m)


def _vtg(fields: Fields, stamp_ns: int, found: _Found, skipped: Skipped) -> Iterator[Sample]:
    if "RMC" in found.formatters:
        return
    mode = fields[8] if len(fields) > 8 else ""
    if mode in _MODES_WITHOUT_FIX or not (fields[4] or fields[6]):
        skipped[NO_FIX] += 1
        return
    knots = bool(fields[4])
    speed_mps = float(fields[4 if knots else 6]) * units.SPEED["kn" if knots else "km/h"]
    yield from _velocity(stamp_ns, speed_mps, fields[0], found)


def _velocity(stamp_ns: int, speed_mps: float, course: str, found: _Found) -> Iterator[Sample]:
    """Yield a speed, and the course over ground where it is the only heading and means one."""
    yield "speed", drive.SpeedSample(stamp_ns=stamp_ns, speed_mps=speed_mps)
    if course and speed_mps >= MIN_COURSE_MPS and "HDT" not in found.formatters:
        yield "heading", drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=_yaw_rad(course))


def _hdt(fields: Fields, stamp_ns: int, _found: _Found, _skipped: Skipped) -> Iterator[Sample]:
    if fields[0]:
        yield "heading", drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=_yaw_rad(fields[0]))


_READERS: dict[str, Callable[[Fields, int, _Found, Skipped], Iterator[Sample]]] = {
    "RMC": _rmc,
    "GGA": _gga,
    "VTG": _vtg,
    "HDT": _hdt,
    # A date and a time, which count for all sentences, and no sample.
    "ZDA": lambda *_: iter(()),
}
