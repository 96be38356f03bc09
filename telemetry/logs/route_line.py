"""Lines of positions without time: given routes, and where a log went."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix
from foretwin.telemetry.logs.geojson import geojson_lines
from foretwin.telemetry.logs.gpx import gpx_lines
from foretwin.telemetry.logs.log import Log, LogError, fault_of_position


class RouteLine(msgspec.Struct, frozen=True, kw_only=True):
    """A line on WGS84: `lat_deg` (N,) and `lon_deg` (N,), N at least 2."""

    lat_deg: Array
    lon_deg: Array
    passed_over: int = 0
    """Other lines of its file, where nobody said which of them is meant."""

    @property
    def lat_lon_deg(self) -> Array:
        """The line as (N, 2) latitudes and longitudes."""
        return np.stack([self.lat_deg, self.lon_deg], axis=-1)


def read_line(path: Path) -> RouteLine:
    """Read a route from GPX (trk, else rte) or GeoJSON.

    `NAME#INDEX` takes another line than the first, counted from 0. Raises FileNotFoundError for
    a missing file and LogError for a file without such a line of two positions or more.
    """
    file, index = _file_and_index(Path(path))
    if file.is_dir():
        raise LogError(f"{file}: is a folder, not a file")
    if not file.is_file():
        raise FileNotFoundError(f"{file}: no such file")
    if file.suffix.lower() == ".gpx":
        lines = gpx_lines(file)
    elif file.suffix.lower() in (".geojson", ".json"):
        lines = [
            ([p[1] for p in line.positions], [p[0] for p in line.positions])
            for line in geojson_lines(file)
        ]
    else:
        raise LogError(f"{file}: a route is a .gpx, .geojson or .json file")
    if not lines:
        raise LogError(f"{file}: holds no track and no route")
    if index >= len(lines):
        raise LogError(f"{file}: has no line {index}; it holds {len(lines)}, counted from 0")
    found = _line(lines[index], where=f"{file}: line {index}")
    chosen = file != Path(path)
    return msgspec.structs.replace(found, passed_over=0 if chosen else len(lines) - 1)


def line_of_log(log: Log, *, start_s: float = 0.0, end_s: float | None = None) -> RouteLine:
    """Return the valid positions of a log from `start_s` to `end_s`, seconds from its start.

    Raises LogError for fewer than two.
    """
    start_ns = log.info.start_stamp_ns + round(start_s * 1e9)
    end_ns = None if end_s is None else log.info.start_stamp_ns + round(end_s * 1e9)
    fixes = []
    for _, message in log.samples():
        if isinstance(message, GnssFix) and message.stamp_ns >= start_ns:
            if end_ns is not None and message.stamp_ns > end_ns:
                break
            fixes.append(message)
    return _line(
        ([fix.position.lat_deg for fix in fixes], [fix.position.lon_deg for fix in fixes]),
        where=log.info.source,
    )


def _file_and_index(path: Path) -> tuple[Path, int]:
    name, mark, index = path.name.rpartition("#")
    if mark and index.isdigit() and not path.exists():
        return path.with_name(name), int(index)
    return path, 0


def _line(positions: tuple[list[float], list[float]], *, where: str) -> RouteLine:
    valid = [
        (lat, lon)
        for lat, lon in zip(*positions, strict=True)
        if fault_of_position(lat, lon) is None
    ]
    if len(valid) < 2:
        raise LogError(f"{where}: {len(valid)} valid position(s); a line needs two")
    table = np.array(valid)
    return RouteLine(lat_deg=table[:, 0].copy(), lon_deg=table[:, 1].copy())
