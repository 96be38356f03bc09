"""The command line of the user's own tracks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.cli_help import CommandGroup
from foretwin.orchestrator.commands.cli_options import DeclarationOption
from foretwin.orchestrator.commands.told import CommandResult, told

tracks = CommandGroup(
    help="Where your car drove, to correct lanes by (docs/tracks.md): yours to list and delete.",
    no_args_is_help=True,
)

StoreOption = Annotated[
    str | None, typer.Option("--store", help="folder of the store [default: your own]")
]


@tracks.command("list")
@told
def list_(store: StoreOption = None) -> CommandResult:
    """List the tracks: id, length, when added, from what.

    Example: foretwin tracks list
    """
    from foretwin.orchestrator.commands.tracks import list_tracks

    return list_tracks(store=store)


@tracks.command()
@told
def add(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="recorded drive, such as RUN/drive.mcap")
    ],
    store: StoreOption = None,
    name: Annotated[str | None, typer.Option(help="what it is called [default: the file]")] = None,
    std_m: Annotated[
        float | None,
        typer.Option(
            "--std",
            help="metres that its positions are off, as a standard deviation, where the "
            "log does not tell: a phone in a town 3, RTK 0.02",
        ),
    ] = None,
    declaration: DeclarationOption = None,
) -> CommandResult:
    """Keep where a recorded drive went.

    Example: foretwin tracks add runs/NAME/drive.mcap
    """
    from foretwin.orchestrator.commands.tracks import add_track

    return add_track(log, store=store, name=name, std_m=std_m, declaration=declaration)


@tracks.command()
@told
def delete(
    ids: Annotated[
        list[str] | None, typer.Argument(metavar="[ID]...", help="ids of tracks")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="all tracks of the store")] = False,
    store: StoreOption = None,
) -> CommandResult:
    """Delete tracks.

    Example: foretwin tracks delete --all
    """
    from foretwin.orchestrator.commands.tracks import delete_tracks

    return delete_tracks(ids or [], everything=everything, store=store)
