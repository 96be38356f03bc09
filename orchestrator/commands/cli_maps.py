"""The command line of maps: fetching, writing and indexing them. The work is imported when run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.cli_help import CommandGroup
from foretwin.orchestrator.commands.cli_options import MapArgument, OutOption
from foretwin.orchestrator.commands.told import CommandResult, told

maps = CommandGroup(name="map", help="Fetch maps and prepare them.", no_args_is_help=True)


@maps.command("get", context_settings={"ignore_unknown_options": True})
@told
def get_map(
    area: Annotated[
        str,
        typer.Argument(metavar="BBOX|ROUTE", help="W,S,E,N in degrees, or a GPX or GeoJSON file"),
    ],
    out: OutOption,
    config: Annotated[Path | None, typer.Option(help="TOML file with these settings")] = None,
) -> CommandResult:
    """Fetch the map of a region, or of a route's surroundings, from an Overpass endpoint.

    Example: foretwin map get ROUTE.gpx --out MAP.osm --config MAPS.toml
    """
    from foretwin.orchestrator.commands.map_get import get_map as fetch

    return fetch(area, out=out, config=config)


@maps.command("town")
@told
def write_town(out: OutOption) -> CommandResult:
    """Write the drawn town's map, to try things on, and a route through it beside the map.

    Example: foretwin map town --out town.osm
    """
    from foretwin.orchestrator.commands.map_town import write_town as write

    return write(out)


@maps.command("index")
@told
def index_map(
    map_file: MapArgument,
    folder: Annotated[
        Path | None, typer.Option(help="folder of indexes [default: the user's cache]")
    ] = None,
) -> CommandResult:
    """Read a map of any size into an index on disk, from which places and routes are clipped.

    Example: foretwin map index GERMANY.osm.pbf
    """
    from foretwin.orchestrator.commands.map_index import index_map_file

    return index_map_file(map_file, folder=folder)
