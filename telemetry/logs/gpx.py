"""Reader of GPX 1.0 and 1.1: tracks with times as logs, tracks and routes as lines.

Declares: degrees on WGS84, altitude in metres as written (GPX does not say above what), times
in UTC (ISO 8601), reference point the receiver's antenna, its place on the car unknown. How good
points are is what `fix` and `hdop` promise, and unknown where neither is told.
"""

from __future__ import annotations

import datetime
import math
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from foretwin.telemetry.logs.columns import stream_of, table_log
from foretwin.telemetry.logs.log import Log, LogError
from foretwin.telemetry.logs.nmea_positions import ALONE, promised_std_m
from foretwin.telemetry.ros_messages.foreign import NO_FIX

_NO_FIX = "none"
_QUALITY_OF_FIX = {"2d": ALONE, "3d": ALONE, "dgps": "2", "pps": "3"}
"""GGA's quality by GPX's fixType."""


class GpxPoint(NamedTuple):
    """One trkpt or rtept; NaN where a coordinate is unreadable or its spread is not told, None
    where no time is given."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    std_m: float
    stamp_ns: int | None
    fixed: bool


def open_gpx(path: Path) -> Log:
    """Open the tracks of a GPX file as one log; raises LogError where no point has a time."""
    points = [point for track in _points(path, "trk", "trkpt") for point in track]
    fixed = [point for point in points if point.fixed]
    timed = [point for point in fixed if point.stamp_ns is not None]
    if not timed:
        raise LogError(f"{path}: track without time; usable as --route only")
    stamps_ns = np.array([point.stamp_ns for point in timed], dtype=np.int64)
    return table_log(
        path.name,
        {"gnss": stream_of("gnss", stamps_ns, np.array([point[:4] for point in timed]))},
        stamps_ns=stamps_ns,
        time_base="utc",
        reference_point="antenna",
        unreadable=len(fixed) - len(timed),
        refused={NO_FIX: len(points) - len(fixed)},
    )


def gpx_lines(path: Path) -> list[tuple[list[float], list[float]]]:
    """Return latitudes and longitudes of every track, else of every route."""
    lines = _points(path, "trk", "trkpt") or _points(path, "rte", "rtept")
    return [([p.lat_deg for p in line], [p.lon_deg for p in line]) for line in lines]


def _points(path: Path, group: str, item: str) -> list[list[GpxPoint]]:
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise LogError(f"{path}: no valid XML: {error}") from None
    if _name(root) != "gpx":
        raise LogError(f"{path}: the root element is <{_name(root)}>, not <gpx>")
    groups = (child for child in root if _name(child) == group)
    found = [[_point(node) for node in line.iter() if _name(node) == item] for line in groups]
    return [line for line in found if line]


def _name(element: ElementTree.Element) -> str:
    return element.tag.rsplit("}", 1)[-1]


def _point(node: ElementTree.Element) -> GpxPoint:
    texts = {_name(child): (child.text or "").strip() for child in node}
    alt_m, hdop = _number(texts.get("ele")), _number(texts.get("hdop"))
    quality = _QUALITY_OF_FIX.get(texts.get("fix", ""))
    std_m = math.nan
    if hdop > 0.0 or quality is not None:
        std_m = promised_std_m(quality or ALONE, hdop if hdop > 0.0 else None)
    return GpxPoint(
        _number(node.get("lat")),
        _number(node.get("lon")),
        alt_m if math.isfinite(alt_m) else 0.0,
        std_m,
        stamp_ns_from_iso(texts.get("time", "")),
        texts.get("fix") != _NO_FIX,
    )


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return math.nan


_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


def stamp_ns_from_iso(text: str) -> int | None:
    """Return ns since 1970 of an ISO 8601 time (UTC where it names no zone), None if it is none."""
    try:
        time = datetime.datetime.fromisoformat(text)
    except ValueError:
        return None
    if time.tzinfo is None:
        time = time.replace(tzinfo=datetime.UTC)
    since = time - _EPOCH
    seconds = since.days * 86_400 + since.seconds
    return representable_ns(seconds * 1_000_000_000 + since.microseconds * 1000)


def representable_ns(stamp_ns: int) -> int | None:
    """Return a stamp that 64 bits hold (the years 1677 to 2262), None for any other."""
    return stamp_ns if abs(stamp_ns) < 2**63 else None
