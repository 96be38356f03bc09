"""Reader of CSV files whose columns are declared (see foretwin.telemetry.logs.declaration)."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pyproj

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import geo_from_ecef, wrap_angle
from foretwin.telemetry.logs import units
from foretwin.telemetry.logs.columns import Stream, stream_of, table_log
from foretwin.telemetry.logs.declaration import (
    Declaration,
    HeadingSection,
    ImuSection,
    PositionSection,
    Section,
    columns_of,
    factor_of,
    read_declaration,
    sections_of,
)
from foretwin.telemetry.logs.gpx import representable_ns, stamp_ns_from_iso
from foretwin.telemetry.logs.log import Log, LogError

Cells = list[str]
Flags = npt.NDArray[np.bool_]


class Table(NamedTuple):
    """Rows with a readable time: stamps (N,), and the cells of each column, N long."""

    path: Path
    stamp_ns: npt.NDArray[np.int64]
    cells: dict[str, Cells]
    unreadable_rows: int


def open_csv(path: Path, *, declaration: Path | None = None) -> Log:
    """Open a CSV by its declaration, `NAME.csv.toml` beside it unless another is given.

    Raises LogError where there is no declaration or it does not fit the columns.
    """
    declaration_path = declaration or path.with_name(path.name + ".toml")
    if not declaration_path.is_file():
        raise LogError(
            f"{path}: units not declared; write {declaration_path.name} beside it"
            " (columns, units, frame, time base), or name a declaration"
        )
    declared = read_declaration(declaration_path)
    table = _read_table(path, declared, declaration_path)
    values: dict[str, dict[str, Array]] = {}
    unreadable = table.unreadable_rows
    picks: dict[str, npt.NDArray[np.int64]] = {}
    for channel, section in sections_of(declared).items():
        values[channel], usable, broken = _numbers(table, section, declaration_path)
        unreadable += broken
        picks[channel] = np.flatnonzero(usable & _is_new(table, section))
    geo = _positions(declaration_path, declared.position, values["gnss"])
    values["gnss"] |= stream_of("gnss", table.stamp_ns, geo).columns
    if (speed := values.get("speed")) is not None and "forward" not in speed:
        speed["forward"] = np.hypot(speed["east"], speed["north"])
    if declared.heading is not None:
        heading = values["heading"]
        heading["yaw"] = _true_yaw(declared.position, declared.heading, heading["yaw"], geo)
        if speed is not None and declared.heading.min_speed_mps > 0.0:
            rows = picks["heading"]
            picks["heading"] = rows[speed["forward"][rows] >= declared.heading.min_speed_mps]
    if declared.imu is not None:
        _turn_axes(declared.imu, values["imu"])
    streams = {
        channel: Stream(table.stamp_ns[rows], {n: v[rows] for n, v in values[channel].items()})
        for channel, rows in picks.items()
    }
    return table_log(
        path.name,
        streams,
        stamps_ns=table.stamp_ns,
        time_base=declared.time.base,
        reference_point=declared.reference_point,
        body_from_antenna_m=declared.body_from_antenna_m,
        unreadable=unreadable,
    )


def _read_table(path: Path, declared: Declaration, declaration_path: Path) -> Table:
    wanted = {declared.time.column}
    for section in sections_of(declared).values():
        wanted.update(column.column for column in columns_of(section).values())
        wanted.update(section.new_when)
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as text:
        reader = csv.reader(text, delimiter=declared.delimiter)
        header = [name.strip() for name in next(reader, [])]
        missing = sorted(wanted - set(header))
        if missing:
            raise LogError(
                f"{path}: line 1: no column {missing[0]!r}, which {declaration_path.name} declares;"
                f" columns: {', '.join(header)}"
            )
        places = {name: header.index(name) for name in wanted}
        stamps: list[int] = []
        cells: dict[str, Cells] = {name: [] for name in wanted}
        unreadable = 0
        stamp_of = _stamp_reader(declared.time.unit or "")
        for row in reader:
            if not any(map(str.strip, row)):
                continue
            stamp_ns = (
                stamp_of(row[places[declared.time.column]]) if len(row) >= len(header) else None
            )
            if stamp_ns is None:
                unreadable += 1
                continue
            stamps.append(stamp_ns)
            for name, place in places.items():
                cells[name].append(row[place])
    if not stamps:
        raise LogError(f"{path}: no row with a readable time in column {declared.time.column!r}")
    return Table(path, np.array(stamps, dtype=np.int64), cells, unreadable)


def _stamp_reader(unit: str) -> Callable[[str], int | None]:
    if unit == units.ISO_TIME:
        return lambda text: stamp_ns_from_iso(text.strip())
    factor = units.TIME_NS[unit]

    def read(text: str) -> int | None:
        try:
            return representable_ns(int((Decimal(text.strip()) * factor).to_integral_value()))
        except (InvalidOperation, ValueError, OverflowError):
            return None

    return read


def _numbers(
    table: Table, section: Section, declaration_path: Path
) -> tuple[dict[str, Array], Flags, int]:
    """Return the section's columns in our units, which rows are usable, and how many are broken.

    A row whose cells are all empty holds no sample; one with some empty or no numbers is broken.
    """
    arrays: dict[str, Array] = {}
    rows = len(table.stamp_ns)
    broken, empties = np.zeros(rows, dtype=bool), np.zeros(rows, dtype=int)
    for field, column in columns_of(section).items():
        numbers, empty, no_number = _floats(table.cells[column.column])
        arrays[field] = numbers * factor_of(declaration_path, field, column)
        empties += empty
        broken |= no_number
    all_empty = empties == len(arrays)
    broken |= (empties > 0) & ~all_empty
    return arrays, ~broken & ~all_empty, int(broken.sum())


def _floats(cells: Cells) -> tuple[Array, Flags, Flags]:
    numbers = np.full(len(cells), math.nan)
    empty, no_number = np.zeros(len(cells), dtype=bool), np.zeros(len(cells), dtype=bool)
    for row, cell in enumerate(cells):
        try:
            numbers[row] = float(cell)
        except ValueError:
            (no_number if cell.strip() else empty)[row] = True
    return numbers, empty, no_number


def _is_new(table: Table, section: Section) -> Flags:
    if not section.new_when:
        return np.ones(len(table.stamp_ns), dtype=bool)
    new = np.zeros(len(table.stamp_ns), dtype=bool)
    for name in section.new_when:
        latest = ""
        for row, cell in enumerate(table.cells[name]):
            # An empty cell says nothing: the value before it stands.
            new[row] |= bool(cell.strip()) and cell != latest
            latest = cell if cell.strip() else latest
    return new


def _positions(path: Path, position: PositionSection, columns: dict[str, Array]) -> Array:
    """Return (N, 3) latitude, longitude, altitude; not finite where the source is not."""
    if position.frame == "ecef":
        return geo_from_ecef(np.stack([columns["x"], columns["y"], columns["z"]], axis=1))
    if position.frame == "projected":
        try:
            convert = pyproj.Transformer.from_crs(position.epsg, 4326, always_xy=True)
        except pyproj.exceptions.CRSError as error:
            raise LogError(f"{path}: [position] epsg {position.epsg}: {error}") from None
        lon_deg, lat_deg = convert.transform(columns["easting"], columns["northing"])
    else:
        lat_deg, lon_deg = columns["latitude"], columns["longitude"]
    altitude = columns.get("altitude", np.zeros(len(lat_deg)))
    return np.stack([lat_deg, lon_deg, np.nan_to_num(altitude, nan=0.0)], axis=1)


def _true_yaw(
    position: PositionSection, heading: HeadingSection, angle_rad: Array, geo: Array
) -> Array:
    """Return yaw counter-clockwise from true east of angles in the declared convention."""
    angle = angle_rad + np.radians(heading.offset_deg)
    ccw = -angle if heading.direction == "clockwise" else angle
    yaw = ccw + (0.5 * np.pi if heading.zero == "north" else 0.0)
    if heading.north == "grid":
        # Meridian convergence: the angle from true to grid north, positive clockwise.
        factors = pyproj.Proj(position.epsg).get_factors(geo[:, 1], geo[:, 0], errcheck=False)
        yaw = yaw - np.radians(factors.meridian_convergence)
    return wrap_angle(yaw)


def _turn_axes(imu: ImuSection, columns: dict[str, Array]) -> None:
    if imu.axes == "forward-right-down":
        for name in ("accel_y", "accel_z", "rate_y", "rate_z"):
            columns[name] = -columns[name]
