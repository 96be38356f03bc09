"""What a CSV's columns mean, declared in TOML: fields, units, frame, time, reference point.

```toml
reference_point = "GNSS antenna"            # and body_from_antenna_m = [x, y, z] where known
[time]
column = "millis"
unit = "ms"
base = "utc"                                # utc, boot, log
[position]
frame = "wgs84"                             # wgs84: latitude, longitude; ecef: x, y, z;
latitude = { column = "lat", unit = "deg" } # projected: easting, northing, and epsg
longitude = { column = "lon", unit = "deg" }
[speed]
forward = { column = "speed", unit = "km/h" } # or east and north, whose length is taken
```

`negate = true` turns a column's sign. `new_when = ["column", …]` in a section yields a sample only
where one of these columns differs from what it was before, for sources that repeat old values; an
empty cell is no change. docs/logs.md has all keys; `foretwin declare` writes a declaration.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Literal

import msgspec

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.drive import TimeBase
from foretwin.contracts.toml_file import load_toml
from foretwin.telemetry.logs import table_times, units
from foretwin.telemetry.logs.columns import CHANNEL_COLUMNS
from foretwin.telemetry.logs.log import LogError


class Column(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One column and its unit."""

    column: str
    """Its name in the line of names, or c1, c2 and so on."""
    unit: str | None = None
    """Needed; units are those of the kind of number, such as m/s, km/h, mph or kn of a speed."""
    negate: bool = False
    """Whether its sign is turned."""


class Section(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What every section may hold: which rows are new, and how late its samples are stamped."""

    new_when: tuple[str, ...] = ()
    """Only rows where one of these columns differs from before are samples."""
    again_s: float = 0.0
    """With `new_when`: what has not changed for so long is a sample again; 0: never."""
    late_s: float = 0.0
    """So much later than measured its samples are stamped."""


class TimeSection(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The clock of the rows."""

    column: str
    """The rows' time."""
    base: TimeBase
    """Whether it counts from 1970, from some start of the clock, or from the log's zero."""
    unit: str | None = None
    """Needed: one of table_times.UNITS, such as ms, or iso8601 (UTC where dates tell no zone)."""
    date: str | None = None
    """Column of the day, where `column` tells the time of day alone."""


class PositionSection(Section, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Positions; `epsg` is the code of a projected system, such as 32633 for UTM zone 33N.

    `origin` is the latitude and longitude in degrees of a plane's zero: x east, y north.
    """

    frame: Literal["wgs84", "ecef", "projected", "local"]
    """Which of the columns below are there."""
    epsg: int | None = None
    """With projected: code of the system."""
    origin: tuple[float, float] | None = None
    """With local: latitude and longitude in degrees of the plane's zero."""
    latitude: Column | None = None
    """With wgs84."""
    longitude: Column | None = None
    """With wgs84."""
    easting: Column | None = None
    """With projected."""
    northing: Column | None = None
    """With projected."""
    x: Column | None = None
    """With ecef; with local, east."""
    y: Column | None = None
    """With ecef; with local, north."""
    z: Column | None = None
    """With ecef."""
    altitude: Column | None = None
    """Above the ellipsoid; not with ecef."""
    std: Column | None = None
    """One standard deviation of the position."""


class SpeedSection(Section, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Speed: `forward`, or `east` and `north`."""

    forward: Column | None = None
    """Along the car."""
    east: Column | None = None
    """Of the velocity, with north."""
    north: Column | None = None
    """Of the velocity, with east."""


class HeadingSection(Section, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Heading or course: where zero lies, which way it grows, and what to add to the column.

    `north` tells whether angles count from true north (east) or from the grid's of
    `position.epsg`. Rows slower than `min_speed_mps` are left out: a course over ground means
    nothing at a standstill.
    """

    yaw: Column
    """The angle."""
    zero: Literal["north", "east"]
    """Where it is zero."""
    direction: Literal["clockwise", "counterclockwise"]
    """Which way it grows, seen from above."""
    north: Literal["true", "grid"] = "true"
    """True north, or that of the grid of position.epsg."""
    offset_deg: float = 0.0
    """Added to the column."""
    min_speed_mps: float = 0.0
    """Slower rows are left out: at a standstill a course means nothing."""
    yaw_rate: Column | None = None
    """Counter-clockwise from above; `negate` where it is not."""


class ImuSection(Section, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Specific force (+9.8 m/s² upwards at rest) and rates along the named body axes.

    Of a unit that measures in the plane alone what is missing is taken as at rest. Without
    `accel_x` it is a gyro without an accelerometer.
    """

    axes: Literal["forward-left-up", "forward-right-down"]
    """Which way x, y and z point."""
    rate_z: Column
    """About z."""
    accel_x: Column | None = None
    """Specific force along x."""
    accel_y: Column | None = None
    """Along y."""
    accel_z: Column | None = None
    """Along z."""
    rate_x: Column | None = None
    """Rate about x."""
    rate_y: Column | None = None
    """About y."""


class SteeringSection(Section, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Steering, positive to the left; `negate` where it is not."""

    wheel: Column | None = None
    """Angle of the steering wheel."""
    tire: Column | None = None
    """Angle of the front tyres."""


class ControlSection(Section, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Commands, positive to the left; `negate` where they are not."""

    accel: Column
    """Acceleration that was commanded."""
    wheel: Column | None = None
    """Angle of the steering wheel that was."""
    tire: Column | None = None
    """Angle of the front tyres that was."""


class Declaration(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The declaration of one kind of CSV."""

    time: TimeSection
    """The clock of the rows."""
    reference_point: str
    """What on the car the positions are of, in words."""
    position: PositionSection | None = None
    """Columns of positions."""
    body_from_antenna_m: tuple[float, float, float] | None = None
    """Its place from the rear axle's centre on the ground: forwards, left, up."""
    delimiter: str = ","
    """Between the cells of a row."""
    decimal: Literal[".", ","] = "."
    """What stands before the decimals of a number."""
    header: bool = True
    """Without a line of names the columns are called c1, c2 and so on."""
    skip_lines: int = 0
    """So many lines stand before the line of names, or before the first row without one."""
    speed: SpeedSection | None = None
    """Columns of speed."""
    heading: HeadingSection | None = None
    """Columns of heading or course."""
    imu: ImuSection | None = None
    """Columns of an inertial unit."""
    steering: SteeringSection | None = None
    """Columns of steering."""
    control: ControlSection | None = None
    """Columns of commands."""


UNITS = units.BY_FIELD
"""Valid units by field, the project's own first, with the factor into it."""


def read_declaration(path: Path) -> Declaration:
    """Read and check a declaration; raises FileNotFoundError, or LogError naming line and field."""
    file = load_toml(path, "declaration", error=LogError)
    declaration = file.convert(Declaration)
    try:
        _check(declaration)
    except ValueError as wrong:
        raise file.wrong(wrong) from None
    return declaration


def _check(declaration: Declaration) -> None:
    unit = _known_unit("time", declaration.time, table_times.UNITS)
    if declaration.time.date is not None and unit not in table_times.DATE_UNITS:
        raise ValueError(f"[time] date belongs to {', '.join(table_times.DATE_UNITS)}")
    if declaration.position is not None:
        _check_position(declaration.position, declaration.heading)
    elif declaration.heading is not None and declaration.heading.north == "grid":
        raise ValueError("[heading] north = 'grid' needs a position in frame 'projected'")
    if declaration.speed is not None:
        present = set(columns_of(declaration.speed))
        if present not in ({"forward"}, {"east", "north"}):
            raise ValueError("[speed] needs either 'forward' or 'east' and 'north'")
    for name, section in sections_of(declaration).items():
        for field, column in columns_of(section).items():
            factor_of(field, column, place=f"{CHANNEL_COLUMNS[name].section}.{field}")


def sections_of(declaration: Declaration) -> dict[str, Section]:
    """Return the present sections by the channel that they feed."""
    given = {name: getattr(declaration, row.section) for name, row in CHANNEL_COLUMNS.items()}
    return {channel: section for channel, section in given.items() if section is not None}


def columns_of(section: Section) -> dict[str, Column]:
    """Return the declared columns of a section by field."""
    return {
        name: value
        for name in section.__struct_fields__
        if isinstance(value := getattr(section, name), Column)
    }


def factor_of(field: str, column: Column, *, place: str = "") -> float:
    """Return the factor of a column into the project's unit, its sign included.

    Raises ValueError naming the column, its `place` in the file and the valid units.
    """
    valid = UNITS[field]
    unit = _known_unit(place, column, valid)
    return -valid[unit] if column.negate else valid[unit]


def _known_unit(place: str, given: Column | TimeSection, valid: Collection[str]) -> str:
    if given.unit in valid:
        return given.unit  # type: ignore[return-value]
    text = f"{place}: column {given.column!r}: ".removeprefix(": ")
    if given.unit is None:
        raise ValueError(f"{text}no unit; one of {', '.join(valid)}")
    raise ValueError(f"{text}unknown unit {given.unit!r}; {one_of(given.unit, valid)}")


def _check_position(position: PositionSection, heading: HeadingSection | None) -> None:
    needed = {
        "wgs84": ("latitude", "longitude"),
        "ecef": ("x", "y", "z"),
        "projected": ("easting", "northing"),
        "local": ("x", "y"),
    }[position.frame]
    present = set(columns_of(position)) - {"std", "altitude"}
    if present != set(needed) or (position.frame == "ecef" and position.altitude is not None):
        raise ValueError(
            f"[position] in frame {position.frame!r} needs exactly {', '.join(needed)}"
            f" (and may have altitude, std); it has {', '.join(sorted(present)) or 'none'}"
        )
    if (position.frame == "projected") != (position.epsg is not None):
        raise ValueError("[position] epsg belongs to frame 'projected', and to it alone")
    if (position.frame == "local") != (position.origin is not None):
        raise ValueError("[position] origin belongs to frame 'local', and to it alone")
    if heading is not None and heading.north == "grid" and position.epsg is None:
        raise ValueError("[heading] north = 'grid' needs a position in frame 'projected'")
