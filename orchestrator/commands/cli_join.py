"""The command line of a car that joins a running drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.cli_options import InsecureOption


def join(
    vehicle_id: Annotated[str, typer.Argument(metavar="ID", help="which of the drive's vehicles")],
    anchor: Annotated[Path, typer.Option(help="TOML file: where its lot is, and in the World")],
    log: Annotated[
        Path | None, typer.Option(help="recorded drive that it replays [default: a stand-in car]")
    ] = None,
    ros2: Annotated[Path | None, typer.Option(help="mapping of its own ROS 2 topics, TOML")] = None,
    route: Annotated[
        Path | None,
        typer.Option(help="of the stand-in: GPX or GeoJSON line in the World [default: straight]"),
    ] = None,
    way_m: Annotated[float, typer.Option("--way", help="metres straight on")] = 100.0,
    speed_mps: Annotated[float, typer.Option("--speed", help="metres per second")] = 8.0,
    run: Annotated[
        Path | None,
        typer.Option(help="folder or id of the run, or latest [default: the newest one running]"),
    ] = None,
    out: Annotated[Path, typer.Option(help="folder of the runs")] = Path("runs"),
    connect: Annotated[
        str | None, typer.Option(help="where the drive listens, tls/HOST:PORT [default: here]")
    ] = None,
    secure: Annotated[
        Path | None, typer.Option(help="the car's certificate: the folder car of the campaign")
    ] = None,
    insecure: InsecureOption = False,
) -> None:
    """Take part in a running drive as a car on a lot of its own (docs/several-cars.md).

    Goes on until the drive is over, or Ctrl-C: there is no result, and no --json.

    Example: foretwin join second --anchor lot-there.toml --connect tls/twin-pc:7447 --secure car
    """
    asked = locals()  # named as the fields of JoinAsked
    from foretwin.orchestrator.commands.join import JoinAsked
    from foretwin.orchestrator.commands.join import join as take_part

    raise typer.Exit(take_part(JoinAsked(**asked)))
