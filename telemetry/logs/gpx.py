"""Reader of GPX 1.0 and 1.1: tracks with times as logs, tracks and routes as lines.

Declares: degrees on WGS84, altitude in metres as written (GPX does not say above what), times
in UTC (ISO 8601), reference point the receiver's antenna, its place on the car unknown.
"""

from __future__ import annotations

import datetime
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.log import UNREADABLE_ROW, Log, LogError, Sample, fixes_log


class GpxPoint(NamedTuple):
    """One trkpt or rtept; NaN where a coordinate is unreadable, None where no time is given."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    stamp_ns: int | None


def open_gpx(path: Path) -> Log:
    """Open the tracks of a GPX file as one log; raises LogError where no point has a time."""
    points = [point for track in _points(path, "trk", "trkpt") for point in track]
    timed = [point for point in points if point.stamp_ns is not None]
    if not timed:
        raise LogError(f"{path}: track without time; usable as --route only")
    stamps_ns = [point.stamp_ns for point in timed if point.stamp_ns is not None]

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if len(timed) < len(points):
            skipped[UNREADABLE_ROW] += len(points) - len(timed)
        for point in timed:
            position = GeoPoint(point.lat_deg, point.lon_deg, point.alt_m)
            yield "gnss", GnssFix(stamp_ns=point.stamp_ns or 0, position=position)

    return fixes_log(path, stamps_ns, read)


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
    alt_m = _number(texts.get("ele"))
    return GpxPoint(
        _number(node.get("lat")),
        _number(node.get("lon")),
        alt_m if math.isfinite(alt_m) else 0.0,
        stamp_ns_from_iso(texts.get("time", "")),
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
    return (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000
