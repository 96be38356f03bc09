"""Sensor files: what a sensor of the market measures, where it sits, and whose word that is."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import msgspec

from foretwin.contracts.errors import MissingFileError
from foretwin.contracts.numbers import Range
from foretwin.contracts.point_cloud import MOST_RAYS, Mount
from foretwin.contracts.toml_file import parse_toml, toml_text

_FOLDER = Path(__file__).parent
DEFAULT_FILE = _FOLDER / "vlp_16.toml"
RANGES: Mapping[str, Range] = MappingProxyType(
    {
        "azimuths": Range(1, MOST_RAYS),
        "rate_hz": Range(0.1, 100.0),
        "min_range_m": Range(0.0, 2000.0),
        "max_range_m": Range(0.1, 2000.0),
        "seen_to_m": Range(0.1, 2000.0),
        "seen_reflectivity": Range(0.001, 1.0),
        "range_std_m": Range(0.0, 10.0),
        "dropout": Range(0.0, 1.0),
    }
)
"""What the numbers of a lidar may be."""


class Lidar(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A lidar that turns: its rings, its azimuths, how far and how well it measures."""

    elevation_deg: tuple[float, ...]
    """Of each ring above the sensor's own plane, from the lowest ring on."""
    azimuths: int
    """Firings of each ring in one turn."""
    rate_hz: float = 10.0
    """Turns in a second."""
    turns: Literal["clockwise", "counter_clockwise"] = "clockwise"
    """Seen from above; a turn begins to the rear."""
    min_range_m: float = 0.5
    """Nothing nearer is measured."""
    max_range_m: float
    """Nothing farther is measured, however bright."""
    seen_to_m: float
    """How far a surface of `seen_reflectivity`, struck squarely, is still seen; darker or more
    slanting ones less far, by the square root."""
    seen_reflectivity: float = 0.8
    """Share of the light that that surface gives back."""
    range_std_m: float
    """Of ranges: one standard deviation of white noise."""
    dropout: float = 0.0
    """Share of firings that are lost, evenly at random."""


class SensorFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The whole file."""

    name: str
    """Of the sensor; what it measures is told under it."""
    source: str
    """Where the numbers come from."""
    mount: Mount = Mount()
    """Where it sits."""
    lidar: Lidar
    """What it measures."""


def bundled_sensors() -> tuple[str, ...]:
    """Return the names of the sensors that come along, for `load_sensor`."""
    return tuple(sorted(file.stem for file in _FOLDER.glob("*.toml")))


def load_sensor(path: Path | str) -> SensorFile:
    """Read a bundled sensor by its name, or a file.

    Raises MissingFileError for neither, and UserError, in one line with file and key, for what is
    no sensor.
    """
    return sensor_of(*sensor_text(path))


def sensor_text(path: Path | str) -> tuple[str, str]:
    """Return the text of a sensor's file and how errors call it; raises MissingFileError."""
    source = _FOLDER / f"{path}.toml" if str(path) in bundled_sensors() else Path(path)
    try:
        return toml_text(source, "sensor file"), f"sensor file {source}"
    except FileNotFoundError as error:
        names = ", ".join(bundled_sensors())
        raise MissingFileError(f"{error}, and no bundled sensor of that name: {names}") from error


def sensor_of(text: str, name: str) -> SensorFile:
    """Return the sensor of a TOML text that errors call `name`; raises UserError."""
    file = parse_toml(text, name)
    found = file.convert(SensorFile)
    try:
        check_sensor(found)
    except ValueError as wrong:
        raise file.wrong(wrong) from wrong
    return found


def check_sensor(sensor: SensorFile) -> None:
    """Raise ValueError naming the first key that no sensor has so."""
    lidar = sensor.lidar
    for owner, table in (("mount", sensor.mount), ("lidar", lidar)):
        for key in table.__struct_fields__:
            value = getattr(table, key)
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{owner}.{key} {value}: a finite number")
    elevations = lidar.elevation_deg
    if not elevations or not all(-90.0 < one < 90.0 for one in elevations):
        raise ValueError("lidar.elevation_deg: one or more angles between -90 and 90")
    if any(b <= a for a, b in itertools.pairwise(elevations)):
        raise ValueError("lidar.elevation_deg: from the lowest ring to the highest")
    if lidar.azimuths * len(elevations) > MOST_RAYS:
        raise ValueError(f"lidar.azimuths {lidar.azimuths}: at most {MOST_RAYS} rays in a turn")
    for key, allowed in RANGES.items():
        if not allowed.admits(getattr(lidar, key)):
            raise ValueError(f"lidar.{key} {getattr(lidar, key):g}: {allowed}")
    if lidar.min_range_m >= lidar.max_range_m:
        raise ValueError(f"lidar.min_range_m {lidar.min_range_m:g}: below lidar.max_range_m")
