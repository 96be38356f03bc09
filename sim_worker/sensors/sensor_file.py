"""Sensor files: what a sensor of the market measures, where it sits, and whose word that is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TypeVar

import msgspec

from foretwin.contracts.errors import MissingFileError, UserError
from foretwin.contracts.numbers import MAX_SEED, Range
from foretwin.contracts.point_cloud import Mount
from foretwin.contracts.toml_file import parse_toml, toml_text
from foretwin.sim_worker.sensors.kinds import (
    KINDS,
    Camera,
    Gnss,
    Imu,
    Kind,
    Lidar,
    Radar,
    check_kind,
)

_FOLDER = Path(__file__).parent
DEFAULT_FILE = _FOLDER / "vlp_16.toml"
RANGES = {"delay_s": Range(0.0, 10.0), "seed": Range(0, MAX_SEED)}
"""What the numbers that all kinds share may be."""
_K = TypeVar("_K", bound=Kind)


class SensorFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The whole file: what all kinds share, and one table that says what is measured."""

    name: str
    """Of the sensor; what it measures is told under it."""
    source: str
    """Where the numbers come from."""
    mount: Mount = Mount()
    """Where it sits."""
    delay_s: float = 0.0
    """So long after it is over a turn is told; its stamp stays."""
    seed: int = 0
    """Added to the drive's: two sensors of one kind have noise of their own in any case."""
    lidar: Lidar | None = None
    """It is a lidar."""
    radar: Radar | None = None
    """It is a radar."""
    camera: Camera | None = None
    """It is a camera."""
    gnss: Gnss | None = None
    """It is a satellite receiver."""
    imu: Imu | None = None
    """It is an inertial sensor."""

    @property
    def kind(self) -> Kind:
        """What it measures; raises ValueError where that is nothing, or more than one thing."""
        tables = self.lidar, self.radar, self.camera, self.gnss, self.imu
        told = [one for one in tables if one is not None]
        if len(told) != 1:
            raise ValueError(f"{len(told)} of {', '.join(KINDS)}: a sensor has one of these tables")
        return told[0]

    @property
    def kind_name(self) -> str:
        """The name of that table."""
        return next(name for name, kind in KINDS.items() if isinstance(self.kind, kind))

    def measures(self, kind: type[_K]) -> _K:
        """Return what it measures; raises UserError where it is of another kind."""
        found = self.kind
        if not isinstance(found, kind):
            wanted = next(name for name, one in KINDS.items() if one is kind)
            raise UserError(f"sensor {self.name}: of kind {self.kind_name}, and {wanted} is needed")
        return found


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
    kind = sensor.kind
    for owner, table in (("", sensor), ("mount.", sensor.mount), (f"{sensor.kind_name}.", kind)):
        for key in table.__struct_fields__:
            value = getattr(table, key)
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{owner}{key} {value}: a finite number")
    for key, allowed in RANGES.items():
        if not allowed.admits(getattr(sensor, key)):
            raise ValueError(f"{key} {getattr(sensor, key):g}: {allowed}")
    check_kind(sensor.kind_name, kind)
