"""The command line of files that users write. The work is imported when run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.told import CommandResult, told


@told
def config(
    example: Annotated[
        bool, typer.Option("--example", help="a file to begin with, each key explained")
    ] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="the JSON Schema, for editors that complete TOML")
    ] = False,
    explain: Annotated[
        str | None, typer.Option(metavar="KEY", help="what a key is, its default and its range")
    ] = None,
    check: Annotated[
        Path | None, typer.Option(metavar="FILE", help="whether a file can be used, and else why")
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(
            help="drive, sweep, scenario, vehicle, declaration, recording, ros2, standin, "
            "overpass, sensor, anchor or layout [default: drive; of --check, what FILE is; of "
            "--explain, all]"
        ),
    ] = None,
) -> CommandResult:
    """Explain the TOML files that foretwin reads: settings, sweeps, vehicles, declarations.

    Example: foretwin config --check SPEC.toml
    """
    asked = {"--example": example, "--schema": schema, "--explain": explain, "--check": check}
    given = [name for name, one in asked.items() if one]
    if len(given) != 1:
        raise UserError(f"config: one of {', '.join(asked)}; got {' and '.join(given) or 'none'}")
    from foretwin.orchestrator.commands import config as command
    from foretwin.orchestrator.commands.config_formats import kind_named

    if kind is not None:
        kind_named(kind)
    if explain is not None:
        return command.explain(explain, kind=kind)
    if check is not None:
        return command.check(check, kind=kind)
    return (command.example if example else command.schema)(kind or "drive")
