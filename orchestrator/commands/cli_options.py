"""Options that several commands have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MapArgument = Annotated[Path, typer.Argument(help="map: .osm, .osm.gz, .osm.bz2 or .osm.pbf")]
ServiceRoadsOption = Annotated[
    bool,
    typer.Option("--service-roads", help="driveways and parking aisles count as roads everywhere"),
]
OutOption = Annotated[Path, typer.Option("--out", help="file to write")]
