"""What a recorded drive is, whatever file it came from, and what of it is refused."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.errors import UserError
from foretwin.contracts.guard import Refused, admit

Sample = tuple[str, msgspec.Struct]
"""Channel name of foretwin.contracts.keys and its message."""

MOST_TIME_S = 4e9
"""Seconds since a start, or since 1970 until the year 2096; beyond is no time."""
MOST_LINE = 1000
"""Characters of why a log cannot be read: libraries quote whole files."""
LOWEST_M, HIGHEST_M = -2_000.0, 20_000.0
"""Altitudes beyond are no car's, however bad its receiver: one number of three is damaged."""
POSITION_NOT_FINITE = "position not finite"
POSITION_ZERO = "position (0, 0)"
POSITION_OFF_EARTH = "position off Earth"
VALUE_NOT_FINITE = "value not finite"
ROAD_USER_ODD = "road user that cannot be"
TIME_BACKWARDS = "time backwards"
TIME_DOUBLED = "time doubled"
CLOCK_NOT_SET = "time of before the clock was set"
TIME_BEFORE_ZERO = "time before zero"
UNREADABLE_ROW = "unreadable row"
FILE_CUT_SHORT = "file cut short"
PART_MISSING = "part of the recording that is not there"
LAST_LINE_OPEN = "last line without its end, of which digits may be missing"


_MOTION = (
    drive.ImuSample,
    drive.SpeedSample,
    drive.HeadingSample,
    drive.SteeringSample,
    drive.ControlCommand,
    drive.PlannedTrajectory,
)
"""Messages that are of no use where one number is missing."""


class LogError(UserError):
    """A log that cannot be read: one line with the file, the line or field, and what would do.

    Of a longer text, as libraries quote whole files, the beginning is kept.
    """

    def __init__(self, text: str) -> None:
        line = " ".join(text.split("\n"))
        super().__init__(line if len(line) <= MOST_LINE else f"{line[:MOST_LINE]} …")


def check_undeclared(path: Path, declaration: Path | None, kind: str) -> None:
    """Refuse a declaration that nothing would be read from."""
    if declaration is not None:
        raise LogError(f"{path}: {kind} says all of itself; leave out --declaration {declaration}")


@dataclass(frozen=True, kw_only=True)
class Log:
    """One recorded drive: its facts, and its samples as often as they are asked for.

    `read` yields samples in stamp order and counts what it cannot read in the counter it is given.
    """

    info: drive.VehicleInfo
    read: Callable[[Counter[str]], Iterator[Sample]]
    skipped: Counter[str] = field(default_factory=Counter)
    """Samples refused by reason, as far as the latest `samples()` has come."""

    def samples(self) -> Iterator[Sample]:
        """Yield every valid sample in stamp order, of an instant speed first and positions last.

        The rest is counted in `skipped`.
        """
        self.skipped.clear()
        yield from _instants_in_order(screened(self.read(self.skipped), self.skipped))


def screened(samples: Iterator[Sample], skipped: Counter[str]) -> Iterator[Sample]:
    """Drop samples with impossible values, and those whose clock stands still or runs backwards.

    The guard that live messages pass is passed here too.

    A doubled stamp is one within a channel (within a group for signals), a backwards one is before
    anything already given, so that what is yielded is in stamp order whatever the source does.
    """
    latest: dict[object, int] = {}
    newest_ns = 0
    for channel, message in samples:
        fault = fault_of(message)
        stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        stream = (channel, getattr(message, "group_id", None))
        if fault is None and stamp_ns < newest_ns:
            fault = TIME_BACKWARDS
        elif fault is None and stamp_ns == latest.get(stream):
            fault = TIME_DOUBLED
        if fault is None:
            try:
                message, left_out = admit(message, where=channel)
            except Refused as refused:
                fault = refused.reason
            else:
                skipped.update({ROAD_USER_ODD: left_out} if left_out else {})
        if fault is not None:
            skipped[fault] += 1
            continue
        latest[stream] = newest_ns = stamp_ns
        yield channel, message


def _instants_in_order(samples: Iterator[Sample]) -> Iterator[Sample]:
    """Let the samples of an instant follow one another as the estimator has them of a live car.

    A state leaves with each position: what stands beside one in a row of a table counts in it. And
    speed tells what bend a yaw rate beside it is.
    """
    for _, instant in itertools.groupby(samples, key=lambda sample: sample[1].stamp_ns):  # type: ignore[attr-defined]
        yield from sorted(instant, key=_rank)


def _rank(sample: Sample) -> int:
    match sample[1]:
        case drive.SpeedSample():
            return 0
        case drive.GnssFix():
            return 2
    return 1


def fault_of(message: msgspec.Struct) -> str | None:
    """Return why a message is refused, or None."""
    if message.stamp_ns < 0:  # type: ignore[attr-defined]
        return TIME_BEFORE_ZERO
    if isinstance(message, drive.GnssFix):
        place = message.position
        if place.alt_m < LOWEST_M or place.alt_m > HIGHEST_M:
            return POSITION_OFF_EARTH
        return fault_of_position(place.lat_deg, place.lon_deg)
    if isinstance(message, _MOTION) and not is_finite(message):
        return VALUE_NOT_FINITE
    return None


def is_finite(value: Any) -> bool:
    """Tell whether all numbers in a message, or in a field of one, are finite."""
    match value:
        case float():
            return math.isfinite(value)
        case np.ndarray():
            return bool(np.isfinite(value).all())
        case msgspec.Struct():
            return all(is_finite(getattr(value, name)) for name in value.__struct_fields__)
        case tuple():
            return all(map(is_finite, value))
    return True


def fault_of_position(lat_deg: float, lon_deg: float) -> str | None:
    """Return why a position cannot be one, or None; (0, 0) is what receivers say without a fix."""
    if not (math.isfinite(lat_deg) and math.isfinite(lon_deg)):
        return POSITION_NOT_FINITE
    if lat_deg == 0.0 and lon_deg == 0.0:
        return POSITION_ZERO
    if abs(lat_deg) > 90.0 or abs(lon_deg) > 180.0:
        return POSITION_OFF_EARTH
    return None
