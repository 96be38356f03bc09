"""Reader of GeoJSON lines (RFC 7946): lines with times as logs, any line as a route.

Declares: degrees on WGS84, longitude before latitude, altitude in metres above the ellipsoid.
Times are no part of the standard; they are read from the properties `coordTimes` (as toGeoJSON
writes them) or `times`: ISO 8601, or numbers, which are seconds since 1970, or milliseconds
where they exceed 1e11. Reference point the receiver's antenna, its place on the car unknown.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foretwin.telemetry.logs.columns import stream_of, table_log
from foretwin.telemetry.logs.gpx import representable_ns, stamp_ns_from_iso
from foretwin.telemetry.logs.log import Log, LogError

_TIME_NAMES = ("coordTimes", "times")


class GeoLine(NamedTuple):
    """One LineString: positions as (longitude, latitude, altitude), and its properties."""

    positions: list[tuple[float, float, float]]
    properties: dict[str, Any]


def geojson_lines(path: Path) -> list[GeoLine]:
    """Return all lines in a FeatureCollection, Feature or bare geometry, in file order.

    The parts of a MultiLineString count as lines of their own. Raises LogError naming what the
    file holds instead, where it holds none.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise LogError(f"{path}: no valid JSON: {error}") from None
    if not isinstance(document, dict) or not isinstance(document.get("type"), str):
        raise LogError(
            f"{path}: no GeoJSON: an object whose `type` is such as FeatureCollection is expected"
        )
    seen: list[str] = []
    lines = list(_lines(document, {}, seen))
    if not lines:
        held = ", ".join(sorted(set(seen))) or "nothing"
        raise LogError(f"{path}: holds no LineString but {held}")
    return lines


def _lines(node: object, properties: dict[str, Any], seen: list[str]) -> Iterator[GeoLine]:
    if not isinstance(node, dict):
        return
    kind = node.get("type")
    if kind == "FeatureCollection":
        for feature in _listed(node.get("features")):
            yield from _lines(feature, {}, seen)
    elif kind == "GeometryCollection":
        for geometry in _listed(node.get("geometries")):
            yield from _lines(geometry, properties, seen)
    elif kind == "Feature":
        told = node.get("properties")
        yield from _lines(node.get("geometry"), told if isinstance(told, dict) else {}, seen)
    elif kind in ("LineString", "MultiLineString"):
        given = _listed(node.get("coordinates"))
        several = kind == "MultiLineString"
        for part in given if several else [given]:
            positions = [_position(position) for position in _listed(part)]
            if positions:
                yield GeoLine(positions, {} if several else properties)
            else:
                seen.append(f"an empty {kind}")
    else:
        seen.append(str(kind))


def _listed(value: object) -> list[Any]:
    """Return a list, nothing where what stands there is none."""
    return value if isinstance(value, list) else []


def _position(position: object) -> tuple[float, float, float]:
    try:
        lon_deg, lat_deg, *rest = (float(number) for number in position)  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        return math.nan, math.nan, 0.0
    return lon_deg, lat_deg, rest[0] if rest else 0.0


def open_geojson(path: Path) -> Log:
    """Open the first line that has times; raises LogError where no line has."""
    line, times = _timed_line(path)
    if len(times) != len(line.positions):
        raise LogError(f"{path}: {len(times)} times for a line of {len(line.positions)} positions")
    stamped = zip(map(_stamp_ns, times), line.positions, strict=True)
    timed = [(stamp, (lat, lon, alt)) for stamp, (lon, lat, alt) in stamped if stamp is not None]
    if not timed:
        raise LogError(f"{path}: no time of the line is ISO 8601 or a number, such as {times[0]!r}")
    stamps_ns = np.array([stamp_ns for stamp_ns, _ in timed], dtype=np.int64)
    return table_log(
        path.name,
        {"gnss": stream_of("gnss", stamps_ns, np.array([place for _, place in timed]))},
        stamps_ns=stamps_ns,
        time_base="utc",
        reference_point="antenna",
        unreadable=len(times) - len(timed),
    )


def _timed_line(path: Path) -> tuple[GeoLine, list[Any]]:
    for line in geojson_lines(path):
        groups = (line.properties, line.properties.get("coordinateProperties") or {})
        for group in groups:
            for name in _TIME_NAMES:
                times = group.get(name) if isinstance(group, dict) else None
                if isinstance(times, list) and times:
                    return line, times
    raise LogError(f"{path}: line without time; usable as --route only")


def _stamp_ns(time: object) -> int | None:
    if isinstance(time, str):
        return stamp_ns_from_iso(time)
    if isinstance(time, bool) or not isinstance(time, int | float):
        return None
    try:
        return representable_ns(round(time * 1e6) if abs(time) > 1e11 else round(time * 1e9))
    except (OverflowError, ValueError):  # infinite, or no number
        return None
