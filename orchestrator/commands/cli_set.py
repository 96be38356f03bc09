"""The command line of a running drive: what is changed while it goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.told import CommandResult, told


@told
def set_value(
    assignment: Annotated[
        str,
        typer.Argument(
            metavar="KEY=VALUE",
            help="role.ID=all, twin, shadow or ghost; correction=free or follow; "
            "vehicle.NAME=a number, pin, unpin or rollback; light.GROUP=a "
            "colour or auto; virtual_traffic=on or off",
        ),
    ],
    run: Annotated[
        Path | None,
        typer.Option(help="folder or id of the run, or latest [default: the newest one running]"),
    ] = None,
    out: Annotated[Path, typer.Option(help="folder of the runs")] = Path("runs"),
    secure: Annotated[
        Path | None, typer.Option(help="the operator's certificate, where the drive wants one")
    ] = None,
) -> CommandResult:
    """Change a running drive: a vehicle's role, the twins' correction, the car's parameters,
    what a light shows, virtual traffic.

    Example: foretwin set vehicle.mass_kg=1500
    """
    from foretwin.orchestrator.commands.set import set_in_drive

    return set_in_drive(assignment, run=run, out=out, secure=secure)
