"""The command line of cars on lots: where a lot is in the World, and the stand-in on it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.cli_options import MapArgument
from foretwin.orchestrator.commands.told import CommandResult, told


@told
def anchor(
    map_file: MapArgument,
    at: Annotated[str | None, typer.Option(help="LAT,LON: on the lane, near a junction")] = None,
    lane: Annotated[
        str | None, typer.Option(help="the lane's id, which --at tells, as w10012.41.44.f0")
    ] = None,
    before_m: Annotated[
        float, typer.Option("--before", help="metres before the lane's end")
    ] = 60.0,
    page: Annotated[
        Path | None, typer.Option(help="FILE.html: a picture on which a click takes a place")
    ] = None,
) -> CommandResult:
    """Print where a lot can be anchored: poses on lanes, as the [world] of an anchor file.

    Example: foretwin anchor MAP.osm --at 52.5127,13.3914
    """
    from foretwin.orchestrator.commands.anchor import show_anchors

    return show_anchors(map_file, at=at, lane_id=lane, before_m=before_m, page=page)


@told
def lights(
    exports: Annotated[
        list[Path],
        typer.Argument(metavar="EXPORT", help="one World as Lanelet2 (.osm), OpenDRIVE (.xodr)"),
    ],
) -> CommandResult:
    """Print by which numbers exports of a World know its lights, as [[light]] rows of a mapping.

    Example: foretwin lights town.osm town.xodr
    """
    from foretwin.orchestrator.commands.lights import show_lights

    return show_lights(exports)


@told
def standin(
    ros2: Annotated[
        Path, typer.Option(help="mapping of its ROS 2 topics, TOML, as foretwin drive reads it")
    ],
    anchor: Annotated[Path, typer.Option(help="TOML file: where its lot lies, and its fence")],
    route: Annotated[
        Path | None,
        typer.Option(help="GPX or GeoJSON line in the World [default: straight on]"),
    ] = None,
    way_m: Annotated[float, typer.Option("--way", help="metres straight on")] = 100.0,
    speed_mps: Annotated[float, typer.Option("--speed", help="metres per second")] = 8.0,
    end_s: Annotated[float, typer.Option("--end", help="seconds after which it ends")] = 120.0,
) -> CommandResult:
    """Drive the stand-in car on a lot, over ROS 2: it brakes for the objects that it is told of.

    Example: foretwin standin --ros2 my.toml --anchor lot.toml
    """
    from foretwin.orchestrator.commands.standin import LotDrive, drive_on_lot

    return drive_on_lot(LotDrive(ros2, anchor, route, way_m, speed_mps, end_s))
