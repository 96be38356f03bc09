"""The formats that a World can be written in: one table, read by the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from foretwin.world_gen.export.choices import (
    Lanelet2Dialect,
    OpenDriveVersion,
    Simulator,
    VehicleKind,
)

if TYPE_CHECKING:  # the command line reads the table for its help, and starts without numpy
    from foretwin.contracts.vehicle import VehicleParameters
    from foretwin.contracts.world import World


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """What only some formats ask for."""

    opendrive_version: OpenDriveVersion = "1.8"
    lanelet2_dialect: Lanelet2Dialect | None = None
    """None: Autoware's where the file has the name that Autoware looks for."""
    simulator: Simulator = "classic"
    vehicles: tuple[tuple[str, VehicleKind], ...] = ()
    """Vehicles of an SDFormat world, name and kind; they need `vehicle`."""
    vehicle: VehicleParameters | None = None


Writer = Callable[["World", Path, ExportOptions], None]


@dataclass(frozen=True, slots=True)
class Format:
    """A format: how its files end, and what writes them."""

    name: str
    suffix: str
    write: Writer
    decided_by_suffix: bool = False
    """Whether the writer goes by the file's suffix."""


# Writers are imported when they are used: each needs libraries that the others do not.
def _plain(module: str, name: str) -> Writer:
    """Return the writer `name` of a module of this package, which has no options."""

    def write(world: World, path: Path, _: ExportOptions) -> None:
        getattr(import_module(f"foretwin.world_gen.export.{module}"), name)(world, path)

    return write


def _sdf(world: World, path: Path, options: ExportOptions) -> None:
    from foretwin.world_gen.export.sdformat import write_sdf
    from foretwin.world_gen.export.sdformat_vehicles import place_vehicles

    vehicles = place_vehicles(world, options.vehicles, options.vehicle) if options.vehicle else ()
    write_sdf(world, path, simulator=options.simulator, vehicles=vehicles)


def _opendrive(world: World, path: Path, options: ExportOptions) -> None:
    from foretwin.world_gen.export.opendrive import write_opendrive

    write_opendrive(world, path, version=options.opendrive_version)


def _lanelet2(world: World, path: Path, options: ExportOptions) -> None:
    from foretwin.world_gen.export.lanelet2 import write_lanelet2

    write_lanelet2(world, path, dialect=options.lanelet2_dialect)


FORMATS: dict[str, Format] = {
    format_.name: format_
    for format_ in (
        Format("mjcf", ".xml", _plain("mjcf", "write_mjcf")),
        Format("sdf", ".sdf", _sdf),
        Format("opendrive", ".xodr", _opendrive),
        Format("lanelet2", ".osm", _lanelet2),
        Format("commonroad", ".xml", _plain("commonroad", "write_commonroad")),
        Format("geojson", ".geojson", _plain("geojson", "write_geojson")),
        Format("svg", ".svg", _plain("picture", "write_picture"), True),
        Format("png", ".png", _plain("picture", "write_picture"), True),
    )
}
DEFAULT_FORMAT = "mjcf"
"""What is written into a folder, and what a suffix of several formats means."""


def formats_by_suffix(suffix: str) -> tuple[str, ...]:
    """Return the names of the formats whose files end so, the default one first."""
    names = (name for name, format_ in FORMATS.items() if format_.suffix == suffix.lower())
    return tuple(sorted(names, key=lambda name: name != DEFAULT_FORMAT))
