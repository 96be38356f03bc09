"""Reader of tables, CSV and Parquet, whose columns are declared (see declaration.py)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pyproj

from foretwin.contracts.arrays import Array, Flags, Indices, Stamps
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_ecef,
    geo_from_local,
    wrap_angle,
)
from foretwin.telemetry.logs import units
from foretwin.telemetry.logs.columns import Stream, stream_of, table_log
from foretwin.telemetry.logs.declaration import (
    Column,
    Declaration,
    HeadingSection,
    ImuSection,
    PositionSection,
    Section,
    TimeSection,
    columns_of,
    factor_of,
    read_declaration,
    sections_of,
)
from foretwin.telemetry.logs.log import LAST_LINE_OPEN, Log, LogError
from foretwin.telemetry.logs.table_cells import Cells, read_cells
from foretwin.telemetry.logs.table_times import days_counted, is_of_day, stamp_reader

_MANY_ROWS = 20_000
"""From so many on another parser is worth its import."""
_FORCES = ("accel_x", "accel_y", "accel_z")
_AT_REST = {"accel_y": 0.0, "accel_z": units.STANDARD_GRAVITY_MPS2, "rate_x": 0.0, "rate_y": 0.0}
"""What a unit that measures forwards and about the vertical alone is taken to say besides: nothing
of ours reads it."""


class Table(NamedTuple):
    """Rows with a readable time: stamps (N,), and the cells of each column, N long."""

    path: Path
    stamp_ns: npt.NDArray[np.int64]
    cells: dict[str, Cells]
    decimal: str
    unreadable_rows: int
    open_end: bool


def open_csv(path: Path, *, declaration: Path | None = None) -> Log:
    """Open a table by its declaration, `NAME.csv.toml` beside it unless another is given.

    Raises LogError where there is no declaration or it does not fit the columns.
    """
    declaration_path = declaration or path.with_name(path.name + ".toml")
    if not declaration_path.is_file():
        raise LogError(
            f"{path}: units not declared; write {declaration_path.name} beside it"
            " (columns, units, frame, time base; `foretwin declare` proposes one and says what of"
            " it the data prove), or name a declaration"
        )
    declared = read_declaration(declaration_path)
    table = _read_table(path, declared, declaration_path)
    values: dict[str, dict[str, Array]] = {}
    unreadable = table.unreadable_rows
    picks: dict[str, npt.NDArray[np.int64]] = {}
    sections = sections_of(declared)
    if not sections:
        raise LogError(f"{declaration_path}: declares no section but [time]: nothing to read")
    for channel, section in sections.items():
        values[channel], usable, broken = _numbers(table, section)
        unreadable += broken
        picks[channel] = np.flatnonzero(usable & _is_new(table, section))
    geo = np.zeros((0, 3))
    if declared.position is not None:
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
        channel: _stream(table.stamp_ns, rows, values[channel], late_s=sections[channel].late_s)
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
        refused={LAST_LINE_OPEN: 1} if table.open_end else None,
    )


def _stream(
    stamps_ns: Stamps, rows: Indices, columns: dict[str, Array], *, late_s: float
) -> Stream:
    """Return a channel's samples, moved by what they are late; none is before the drive's start."""
    moved_ns = stamps_ns - round(late_s * 1e9)
    rows = rows[(moved_ns[rows] >= stamps_ns[0]) | (late_s == 0.0)]
    return Stream(moved_ns[rows], {name: column[rows] for name, column in columns.items()})


def _read_table(path: Path, declared: Declaration, declaration_path: Path) -> Table:
    wanted = {declared.time.column}
    if declared.time.date is not None:
        wanted.add(declared.time.date)
    for section in sections_of(declared).values():
        wanted.update(column.column for column in columns_of(section).values())
        wanted.update(section.new_when)
    cells, unreadable, open_end = read_cells(
        path,
        wanted=sorted(wanted),
        declared_in=declaration_path.name,
        delimiter=declared.delimiter,
        header=declared.header,
        skip_lines=declared.skip_lines,
    )
    stamps = _stamps(declared.time, cells, declared.decimal)
    if None in stamps:
        kept = [row for row, stamp_ns in enumerate(stamps) if stamp_ns is not None]
        unreadable += len(stamps) - len(kept)
        cells = {name: [column[row] for row in kept] for name, column in cells.items()}
    known = np.array([stamp_ns for stamp_ns in stamps if stamp_ns is not None], dtype=np.int64)
    if not len(known):
        raise LogError(f"{path}: no row with a readable time in column {declared.time.column!r}")
    return Table(path, known, cells, declared.decimal, unreadable, open_end)


def _stamps(time: TimeSection, cells: dict[str, Cells], decimal: str) -> list[int | None]:
    texts = cells[time.column]
    if time.date is not None:
        texts = [f"{day} {text}" for day, text in zip(cells[time.date], texts, strict=True)]
    unit = time.unit or ""
    stamp_of = stamp_reader(unit, decimal)
    stamps = [stamp_of(text) for text in texts]
    return days_counted(stamps) if is_of_day(unit) else stamps


def _numbers(table: Table, section: Section) -> tuple[dict[str, Array], Flags, int]:
    """Return the section's columns in our units, which rows are usable, and how many are broken.

    A row whose cells are all empty holds no sample; one with some empty or no numbers is broken.
    """
    arrays: dict[str, Array] = {}
    rows = len(table.stamp_ns)
    broken, empties = np.zeros(rows, dtype=bool), np.zeros(rows, dtype=int)
    for field, column in columns_of(section).items():
        numbers, empty, no_number = _floats(table.cells[column.column], table.decimal)
        arrays[field] = _in_our_unit(numbers, field, column)
        empties += empty
        broken |= no_number
    all_empty = empties == len(arrays)
    broken |= (empties > 0) & ~all_empty
    return arrays, ~broken & ~all_empty, int(broken.sum())


def _in_our_unit(numbers: Array, field: str, column: Column) -> Array:
    if field in ("latitude", "longitude"):
        degrees = units.degrees_of(numbers, column.unit or "")
        return -degrees if column.negate else degrees
    return numbers * factor_of(field, column)


def _floats(cells: Cells, decimal: str) -> tuple[Array, Flags, Flags]:
    if decimal != ".":
        cells = [cell.replace(decimal, ".") for cell in cells]
    rows = len(cells)
    empty, no_number = np.zeros(rows, dtype=bool), np.zeros(rows, dtype=bool)
    if rows > _MANY_ROWS and (parsed := _parsed_at_once(cells)) is not None:
        return parsed, empty, no_number
    try:
        return np.array([float(cell) for cell in cells]), empty, no_number
    except ValueError:
        numbers = np.full(rows, math.nan)
    for row, cell in enumerate(cells):
        try:
            numbers[row] = float(cell)
        except ValueError:
            (no_number if cell.strip() else empty)[row] = True
    return numbers, empty, no_number


def _parsed_at_once(cells: Cells) -> Array | None:
    """Return the numbers of cells that all hold one, plainly written; None where one does not."""
    import pyarrow as pa
    import pyarrow.compute as pc

    try:
        numbers = pc.cast(pa.array(cells, pa.string()), pa.float64())
    except pa.ArrowInvalid:
        return None
    return np.array(numbers, dtype=np.float64)


def _is_new(table: Table, section: Section) -> Flags:
    rows = len(table.stamp_ns)
    if not section.new_when:
        return np.ones(rows, dtype=bool)
    new = np.zeros(rows, dtype=bool)
    for name in section.new_when:
        before = ""
        for row, cell in enumerate(table.cells[name]):
            if cell != before and cell.strip():
                new[row], before = True, cell
    if section.again_s > 0.0:
        since_ns = table.stamp_ns - table.stamp_ns[_latest(new)]
        times = since_ns // round(section.again_s * 1e9)
        new[1:] |= (times[1:] > 0) & (times[1:] != times[:-1])
    return new


def _latest(flags: Flags) -> Indices:
    """Return for each row the latest that is flagged, up to it."""
    return np.maximum.accumulate(np.where(flags, np.arange(len(flags)), 0))


def _positions(path: Path, position: PositionSection, columns: dict[str, Array]) -> Array:
    """Return (N, 3) latitude, longitude, altitude; not finite where the source is not."""
    if position.frame == "ecef":
        return geo_from_ecef(np.stack([columns["x"], columns["y"], columns["z"]], axis=1))
    if position.frame == "projected":
        try:
            convert = pyproj.Transformer.from_crs(position.epsg, 4326, always_xy=True)
        except pyproj.exceptions.CRSError as error:
            raise LogError(f"{path}: [position] epsg {position.epsg}: {error}") from None
        easting, northing = (
            columns[name] / _axis_m(convert, getattr(position, name).unit)
            for name in ("easting", "northing")
        )
        lon_deg, lat_deg = convert.transform(easting, northing)
    elif position.origin is not None:
        plane = LocalFrame(GeoPoint(*position.origin).validate())
        xy_m = np.stack([columns["x"], columns["y"]], axis=1)
        lat_deg, lon_deg = geo_from_local(plane, xy_m).T
    else:
        lat_deg, lon_deg = columns["latitude"], columns["longitude"]
    altitude = columns.get("altitude", np.zeros(len(lat_deg)))
    return np.stack([lat_deg, lon_deg, np.nan_to_num(altitude, nan=0.0)], axis=1)


def _axis_m(convert: pyproj.Transformer, unit: str | None) -> float:
    """Return the metres in a step of a projected system's axis, as a column in `unit` means it.

    Systems in feet mean their own, which is 2 ppm longer in the USA: feet are handed on as such.
    """
    crs = convert.source_crs
    axis_m = crs.axis_info[0].unit_conversion_factor if crs and crs.axis_info else 1.0
    foot_m = units.LENGTH["ft"]
    return foot_m if unit == "ft" and abs(axis_m - foot_m) < 1e-5 else axis_m


def _true_yaw(
    position: PositionSection | None, heading: HeadingSection, angle_rad: Array, geo: Array
) -> Array:
    """Return yaw counter-clockwise from true east of angles in the declared convention."""
    angle = angle_rad + np.radians(heading.offset_deg)
    ccw = -angle if heading.direction == "clockwise" else angle
    yaw = ccw + (0.5 * np.pi if heading.zero == "north" else 0.0)
    if heading.north == "grid" and position is not None:
        # Meridian convergence: the angle from true to grid north, positive clockwise.
        factors = pyproj.Proj(position.epsg).get_factors(geo[:, 1], geo[:, 0], errcheck=False)
        yaw = yaw - np.radians(factors.meridian_convergence)
    return wrap_angle(yaw)


def _turn_axes(imu: ImuSection, columns: dict[str, Array]) -> None:
    if imu.axes == "forward-right-down":
        for name in {"accel_y", "accel_z", "rate_y", "rate_z"} & columns.keys():
            columns[name] = -columns[name]
    if "accel_x" not in columns:
        columns |= dict.fromkeys(_FORCES, np.zeros(len(columns["rate_z"])))
    for name, at_rest in _AT_REST.items():
        columns.setdefault(name, np.full(len(columns["rate_z"]), at_rest))
