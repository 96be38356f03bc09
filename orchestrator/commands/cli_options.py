"""Options of commands: those that several have, and long ones."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MapArgument = Annotated[
    Path, typer.Argument(metavar="MAP", help="map: .osm, .osm.gz, .osm.bz2 or .osm.pbf")
]
VehicleFileOption = Annotated[
    str | None,
    typer.Option(
        "--vehicle",
        help="vehicle parameters, TOML, or a bundled name such as city_bus [default: bmw_320i]",
    ),
]
ServiceRoadsOption = Annotated[
    bool,
    typer.Option("--service-roads", help="driveways and parking aisles count as roads everywhere"),
]
DialectOption = Annotated[
    str | None,
    typer.Option(
        "--lanelet2-dialect",
        help="lanelet2: lanelet2, or autoware, which has rules of crosswalks "
        "[default: autoware for lanelet2_map.osm, else lanelet2]",
    ),
]
DemOption = Annotated[
    Path | None,
    typer.Option("--dem", help="heights: .hgt, .hgt.zip, GeoTIFF, or a folder [default: flat]"),
]
TracksOption = Annotated[
    str | None,
    typer.Option(
        "--tracks", help="lanes lie where you drove: own, or a store's folder [default: none]"
    ),
]
DeclarationOption = Annotated[
    Path | None,
    typer.Option(
        "--declaration", help="TOML that declares LOG [default: LOG.toml, where it is there]"
    ),
]
FirstDeclarationOption = Annotated[
    Path | None,
    typer.Option(
        "--declaration", help="TOML that declares LOG_A [default: LOG_A.toml, where it is there]"
    ),
]
OtherDeclarationOption = Annotated[
    Path | None,
    typer.Option(
        "--other-declaration",
        help="TOML that declares LOG_B [default: LOG_B.toml, where it is there]",
    ),
]
LeastFuturesOption = Annotated[
    int | None,
    typer.Option(
        help="futures per round where the machine is too slow for all; "
        "as many as --futures holds them fixed [default: a quarter]"
    ),
]
KeepOption = Annotated[
    str | None,
    typer.Option(help="the newest of a run that stay, such as 12h or 20GB [default: all]"),
]
MapAidingOption = Annotated[
    str | None, typer.Option(help="roads help to find the car: auto, off [default: auto]")
]
TuningOption = Annotated[
    str | None,
    typer.Option(
        help="parameters from the driving: off, report, apply [default: report; off where "
        "there are fewer processors than workers]"
    ),
]
ProgressTableOption = Annotated[
    str | None,
    typer.Option(
        help="how far the car will get: a table of foretwin learn-progress, or off "
        "[default: the shipped one]"
    ),
]
VirtualTrafficOption = Annotated[
    str | None,
    typer.Option(
        help="road users who exist nowhere else: model, scenario, sumo, or off [default: off]"
    ),
]
SiblingsOption = Annotated[
    str | None,
    typer.Option(
        help="a second engine plays nominal and worst futures too: multibody, gazebo, or off "
        "[default: off]"
    ),
]
EndpointOption = Annotated[
    str | None,
    typer.Option(
        help="where the bus listens, such as tls/HOST:7447 with --secure "
        "[default: a socket of this user's]"
    ),
]
InsecureOption = Annotated[
    bool, typer.Option("--insecure", help="whoever reaches the endpoint may say anything")
]
SecureOption = Annotated[
    str | None,
    typer.Option(help="a campaign's folder (foretwin secure init): who speaks shows a certificate"),
]
MetricsOption = Annotated[
    str | None,
    typer.Option(
        help="tell operators metrics on this port of 127.0.0.1, or on HOST:PORT [default: none]"
    ),
]
AnchorOption = Annotated[
    str | None,
    typer.Option(help="TOML file: which place of the World the car's lot is [default: the same]"),
]
OutOption = Annotated[Path, typer.Option("--out", help="file to write")]
