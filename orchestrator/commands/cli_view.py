"""The command line of the viewer: what is shown, how, and where."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Shown(StrEnum):
    """Where a recording is shown."""

    native = "native"
    web = "web"


LayoutOption = Annotated[
    str | None,
    typer.Option("--layout", help="drive, identify, gap or sweep, or a TOML file [default: drive]"),
]


def view(
    run: Annotated[
        Path, typer.Argument(metavar="[RUN]", help="folder or id of a run, or latest")
    ] = Path("latest"),
    out: Annotated[Path, typer.Option(help="folder of the runs")] = Path("runs"),
    layout: Annotated[
        str | None,
        typer.Option(help="drive, identify, gap or sweep, or a TOML file [default: the run's own]"),
    ] = None,
    shown: Annotated[
        Shown, typer.Option("--view", help="in a window, or served for a browser until Ctrl-C")
    ] = Shown.native,
) -> None:
    """Open the recording of a run in the viewer.

    Goes on until the window is closed, or Ctrl-C: there is no result, and no --json.

    Example: foretwin view latest --layout gap
    """
    from foretwin.orchestrator.commands.view import open_view

    raise typer.Exit(open_view(run, out=out, layout=layout, view=shown.value))
