"""Reader of NMEA-0183 logs: RMC, GGA, VTG, HDT and ZDA of any talker, one sentence per line.

Of each instant the position is GGA's, where it has one, else RMC's. Altitude is made ellipsoidal
with GGA's geoid separation, and the standard deviation is what quality and HDOP promise; an RMC
between two GGAs has the altitude and HDOP of the last GGA and the quality of its own mode. Speed is
RMC's in knots, else VTG's. Yaw is HDT's heading; where none has been told for some seconds it is
the course over ground above MIN_COURSE_MPS. Degrees are clockwise from true north. Dates are RMC's
or ZDA's, else the one declared in `NAME.toml` beside the log; without any of them times count from
the log's first. Where only times are told, one that falls by half a day or more begins the next
day, and one of just before midnight that comes after it is of the day before.
Sentences without a time (VTG, HDT) get that of the sentence before; HDT that of the next, where a
log shows that an instant begins with it. Lines may have something before
the `$`; a wrong checksum is counted, a missing one is let pass.
"""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs import units
from foretwin.telemetry.logs.log import (
    LAST_LINE_OPEN,
    UNREADABLE_ROW,
    Log,
    LogError,
    Sample,
)
from foretwin.telemetry.logs.map_origin import declaration_beside
from foretwin.telemetry.logs.merge import WINDOW_NS, reordered
from foretwin.telemetry.logs.nmea_positions import (
    QUALITY_OF_MODE,
    STD_M,
    NmeaCourse,
    NmeaPosition,
    joined,
)
from foretwin.telemetry.logs.nmea_sentences import (
    Fields,
    Sentence,
    date_of,
    degrees_of,
    is_any_sentence,
    midnight_ns,
    sentence_of,
    time_of_day_ns,
    yaw_rad_of,
)
from foretwin.telemetry.logs.table_times import DAY_NS, days_on
from foretwin.telemetry.ros_messages.foreign import NO_FIX

NO_TIME = "sentence before any time"
DATE_UNKNOWN = "date unknown"
MIN_COURSE_MPS = 2.0
"""A course over ground means nothing at a standstill."""
_MODES_WITHOUT_FIX = ("N", "E", "M", "S")
"""Mode indicators: not valid, estimated, manual, simulator."""

Skipped = Counter[str]

_UBX = "\ufffdb"
"""What the first two bytes of a u-blox message are as text; such hold zeros, texts hold none."""


class NmeaDeclaration(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a log does not say of itself: the day of its first time (UTC), the antenna's place."""

    date: datetime.date | None = None
    body_from_antenna_m: drive.Vector3 | None = None


class _Found(NamedTuple):
    """What a file holds, which decides what is taken from where; `dated` where it tells days.

    `heading_first` where an HDT is of the instant that is told after it.
    """

    formatters: frozenset[str]
    first_date: datetime.date
    first_time_ns: int
    dated: bool
    heading_first: bool


def is_nmea(text: str) -> bool:
    """Tell whether a text begins like an NMEA-0183 log."""
    lines = text.splitlines()[:20]
    if text.startswith(("<", "{")):
        return False
    # Receivers tell all satellites before the first position.
    return any(
        sentence_of(line.partition("*")[0]) is not None or is_any_sentence(line) for line in lines
    )


def open_nmea(path: Path, *, declaration: Path | None = None) -> Log:
    """Open an NMEA-0183 log; `declaration`, else `NAME.toml` beside it, is an NmeaDeclaration.

    Raises LogError where it tells no position, or another date than the one declared.
    """
    declared = declaration_beside(path, declaration, NmeaDeclaration) or NmeaDeclaration()
    found = _survey(path, declared.date)
    sends: dict[str, None] = {}
    first_ns = last_ns = None
    for channel, message in joined(_samples(path, found, Counter())):
        stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        sends[channel] = None
        first_ns = stamp_ns if first_ns is None else min(first_ns, stamp_ns)
        last_ns = stamp_ns if last_ns is None else max(last_ns, stamp_ns)
    if first_ns is None or "gnss" not in sends:
        raise LogError(f"{path}: no RMC or GGA sentence with a fix, so no positions")
    return Log(
        info=drive.VehicleInfo(
            vehicle_id="car",
            time_base="utc" if found.dated else "log",
            start_stamp_ns=first_ns,
            end_stamp_ns=last_ns,
            source=path.name if found.dated else f"{path.name} ({DATE_UNKNOWN})",
            reference_point="antenna",
            body_from_antenna_m=declared.body_from_antenna_m,
            sends=tuple(sends),
        ),
        read=lambda skipped: joined(reordered(_samples(path, found, skipped), window_ns=WINDOW_NS)),
    )


def _lines(path: Path) -> Iterator[str]:
    with path.open(encoding="utf-8-sig", errors="replace") as text:
        yield from text


def _survey(path: Path, declared: datetime.date | None) -> _Found:
    formatters, first = set(), None
    begins, ends = "", ""
    first_time_ns: int | None = None
    for line in _lines(path):
        sentence = sentence_of(line)
        if not isinstance(sentence, Sentence):
            continue
        formatters.add(sentence.formatter)
        begins, ends = begins or sentence.formatter, sentence.formatter
        try:
            time_ns, date = time_of_day_ns(sentence), date_of(sentence)
        except (ValueError, IndexError, OverflowError):  # counted when it is read
            continue
        if time_ns is None:
            continue
        first_time_ns = time_ns if first_time_ns is None else first_time_ns
        if first is None and date is not None:
            # What came before the first date may be of the day before.
            late = first_time_ns - time_ns > DAY_NS // 2
            first = date - datetime.timedelta(days=1) if late else date
    if first_time_ns is None:
        raise LogError(f"{path}: no RMC, GGA or ZDA sentence with a time")
    if first is not None and declared is not None and first != declared:
        raise LogError(f"{path}: its RMC or ZDA tell {first}, and {declared} is declared")
    first = first or declared
    return _Found(
        frozenset(formatters),
        first or datetime.date(1970, 1, 1),
        first_time_ns,
        dated=first is not None,
        # Receivers pause between instants, and logs begin and end there: one of which HDT is the
        # last word may begin with it as well, where it was begun within an instant.
        heading_first=begins == "HDT" and ends != "HDT",
    )


def _samples(path: Path, found: _Found, skipped: Skipped) -> Iterator[Sample]:
    date, latest_ns, stamp_ns = found.first_date, found.first_time_ns, None
    zero_ns, mixed = 0 if found.dated else found.first_time_ns, False
    early: list[Fields] = []
    for line in _lines(path):
        if "*" not in line and not line.endswith("\n"):
            skipped[LAST_LINE_OPEN] += 1
            continue
        mixed = mixed or _UBX in line
        if "\0" in line and not mixed:  # of a disk that filled up: lines may have gone with it
            skipped[UNREADABLE_ROW] += 1
        sentence = sentence_of(line)
        if sentence is None:
            continue
        if isinstance(sentence, str):
            skipped[sentence] += 1
            continue
        try:
            time_ns = time_of_day_ns(sentence)
            if time_ns is not None:
                stated = date_of(sentence)
                days = datetime.timedelta(days=days_on(time_ns, latest_ns))
                date, latest_ns = stated or date + days, time_ns
                stamp_ns = midnight_ns(date) + time_ns - zero_ns
            if found.heading_first and sentence.formatter == "HDT":
                early.append(sentence.fields)
                continue
            if stamp_ns is None:
                skipped[NO_TIME] += 1
                continue
            while early and time_ns is not None:
                yield from _hdt(early.pop(0), stamp_ns, found, skipped)
            yield from _READERS[sentence.formatter](sentence.fields, stamp_ns, found, skipped)
        except (ValueError, IndexError, OverflowError):
            skipped[UNREADABLE_ROW] += 1


def _rmc(fields: Fields, stamp_ns: int, _found: _Found, skipped: Skipped) -> Iterator[Sample]:
    mode = fields[11] if len(fields) > 11 else ""
    if fields[1] != "A" or mode in _MODES_WITHOUT_FIX:
        skipped[NO_FIX] += 1
        return
    position = GeoPoint(
        degrees_of(fields[2], fields[3], "S", "N"), degrees_of(fields[4], fields[5], "W", "E")
    )
    quality = QUALITY_OF_MODE.get(mode, "")
    yield "gnss", NmeaPosition(stamp_ns, position, quality, None, False)
    if fields[6]:
        yield from _velocity(stamp_ns, float(fields[6]) * units.SPEED["kn"], fields[7])


def _gga(fields: Fields, stamp_ns: int, _found: _Found, skipped: Skipped) -> Iterator[Sample]:
    quality = fields[5]
    # 6 estimated, 7 manual, 8 simulator: none of them was measured.
    if quality not in STD_M:
        skipped[NO_FIX] += 1
        return
    height_m = float(fields[8]) if fields[8] else 0.0
    separation_m = float(fields[10]) if len(fields) > 10 and fields[10] else 0.0
    position = GeoPoint(
        degrees_of(fields[1], fields[2], "S", "N"),
        degrees_of(fields[3], fields[4], "W", "E"),
        height_m + separation_m,
    )
    hdop = float(fields[7]) if fields[7] else 1.0
    yield "gnss", NmeaPosition(stamp_ns, position, quality, hdop, True)


def _vtg(fields: Fields, stamp_ns: int, found: _Found, skipped: Skipped) -> Iterator[Sample]:
    if "RMC" in found.formatters:
        return
    mode = fields[8] if len(fields) > 8 else ""
    if mode in _MODES_WITHOUT_FIX or not (fields[4] or fields[6]):
        skipped[NO_FIX] += 1
        return
    knots = bool(fields[4])
    speed_mps = float(fields[4 if knots else 6]) * units.SPEED["kn" if knots else "km/h"]
    yield from _velocity(stamp_ns, speed_mps, fields[0])


def _velocity(stamp_ns: int, speed_mps: float, course: str) -> Iterator[Sample]:
    """Yield a speed, and the course over ground where it means a heading."""
    yield "speed", drive.SpeedSample(stamp_ns=stamp_ns, speed_mps=speed_mps)
    if course and speed_mps >= MIN_COURSE_MPS:
        yield "heading", NmeaCourse(stamp_ns, yaw_rad_of(float(course)))


def _hdt(fields: Fields, stamp_ns: int, _found: _Found, _skipped: Skipped) -> Iterator[Sample]:
    if fields[0]:
        yaw_rad = yaw_rad_of(float(fields[0]))
        yield "heading", drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=yaw_rad)


_READERS: dict[str, Callable[[Fields, int, _Found, Skipped], Iterator[Sample]]] = {
    "RMC": _rmc,
    "GGA": _gga,
    "VTG": _vtg,
    "HDT": _hdt,
    # A date and a time, which count for all sentences, and no sample.
    "ZDA": lambda *_: iter(()),
}
