"""RMC, GGA and HDT of one instant joined: one position, how good it promises to be, one heading."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import msgspec

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.log import Sample
from foretwin.telemetry.logs.merge import stamp_ns_of

_HELD_NS = 10_000_000_000
"""So long an HDOP is believed: satellites come and go by the minute, bridges by the second."""
_HEADING_HELD_NS = 5_000_000_000
"""Compasses tell headings each second or more often; one that has missed five has none."""
STD_M = {"1": 2.1, "2": 1.7, "3": 2.1, "4": 0.015, "5": 0.3, "9": 1.7}
"""One standard deviation on each axis at an HDOP of 1, by GGA's quality: 2.5 m CEP alone and 2 m
with SBAS (u-blox NEO-M8 data sheet, over 1.177), 1 cm + 1 ppm CEP with RTK (ZED-F9P data sheet);
floating RTK is chosen."""
_LEAST_HDOP = 0.5
ALONE = "1"
"""The quality of a receiver without corrections, which older RMCs do not tell: NMEA before 2.3."""
QUALITY_OF_MODE = {"A": ALONE, "D": "2", "P": "3", "R": "4", "F": "5"}
"""GGA's quality by RMC's mode indicator: alone, differential, precise, RTK fixed and floating."""


class NmeaPosition(msgspec.Struct, frozen=True):
    """A position of GGA or RMC, which tells no altitude and no HDOP, before instants are joined."""

    stamp_ns: int
    position: GeoPoint
    quality: str
    hdop: float | None
    is_gga: bool


class NmeaCourse(msgspec.Struct, frozen=True):
    """A course over ground, which is taken for the heading where no compass tells one."""

    stamp_ns: int
    yaw_rad: float


def joined(samples: Iterable[Sample]) -> Iterator[Sample]:
    """Give each instant's position and heading once, and RMC's what only GGA tells."""
    gga: NmeaPosition | None = None
    compass_ns: int | None = None
    for stamp_ns, instant in itertools.groupby(samples, key=stamp_ns_of):
        at_once = list(instant)
        known = any(isinstance(said, NmeaPosition) and said.is_gga for _, said in at_once)
        if any(isinstance(said, drive.HeadingSample) for _, said in at_once):
            compass_ns = stamp_ns
        for channel, said in at_once:
            if isinstance(said, NmeaCourse):
                if compass_ns is None or stamp_ns - compass_ns > _HEADING_HELD_NS:
                    yield channel, drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=said.yaw_rad)
            elif not isinstance(said, NmeaPosition):
                yield channel, said
            elif said.is_gga or not known:
                gga = said if said.is_gga else gga
                yield channel, _fix(said, gga)


def _fix(said: NmeaPosition, gga: NmeaPosition | None) -> drive.GnssFix:
    position, quality, hdop = said.position, said.quality, said.hdop
    if gga is not None and not said.is_gga:
        position = GeoPoint(position.lat_deg, position.lon_deg, gga.position.alt_m)
        if said.stamp_ns - gga.stamp_ns <= _HELD_NS:
            quality, hdop = quality or gga.quality, gga.hdop
    std_m = promised_std_m(quality or ALONE, hdop)
    return drive.GnssFix(stamp_ns=said.stamp_ns, position=position, std_m=std_m)


def promised_std_m(quality: str, hdop: float | None) -> float:
    """Return how good a fix of a quality of GGA's promises to be, one standard deviation on each
    axis; where no HDOP is known, at one of 1."""
    return STD_M[quality] * (1.0 if hdop is None else max(hdop, _LEAST_HDOP))
