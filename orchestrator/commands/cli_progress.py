"""The command line of learning how far a car gets. The work is imported when run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.told import CommandResult, told


@told
def learn_progress(
    logs: Annotated[
        list[Path] | None, typer.Argument(metavar="LOG...", help="recorded drives to learn from")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="the table, for progress_table of a drive; .npz")
    ] = None,
    check: Annotated[
        list[Path] | None, typer.Option(help="a drive to check the table on; may be repeated")
    ] = None,
    table: Annotated[
        str | None,
        typer.Option(help="table to check, where nothing is learnt [default: the shipped one]"),
    ] = None,
    licence: Annotated[
        str, typer.Option(help="of the drives, and so of the table; stands in it")
    ] = "of the drives' owner",
) -> CommandResult:
    """Learn from drives how far a car gets in the next seconds (docs/progress.md).

    Example: foretwin learn-progress DRIVE_1.mcap DRIVE_2.mcap --out OURS.npz
    """
    from foretwin.orchestrator.commands.learn_progress import learn_progress as learn

    return learn(logs or [], out=out, check=check or [], table=table, licence=licence)
