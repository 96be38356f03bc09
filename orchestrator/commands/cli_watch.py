"""The command line of the co-pilot display at another seat."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def watch(
    run: Annotated[
        Path | None,
        typer.Argument(
            help="id or folder of a run; one that is over is shown again "
            "[default: the newest one running]"
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="folder of the runs")] = Path("runs"),
    listen: Annotated[
        str | None,
        typer.Option(help="HOST:PORT of the page, over a network with --secure [default: here]"),
    ] = None,
    secure: Annotated[
        Path | None, typer.Option(help="the campaign's certificates (foretwin secure init)")
    ] = None,
    operate: Annotated[
        bool, typer.Option("--operate", help="let the page change roles, as foretwin set does")
    ] = False,
    name: Annotated[str, typer.Option(help="who marks events there")] = "watch",
) -> None:
    """Open the co-pilot display of a drive from another seat, or of one that is over.

    Goes on until the drive is over, or Ctrl-C: there is no result, and no --json.

    Example: foretwin watch latest
    """
    from foretwin.orchestrator.commands.watch import WatchRequest
    from foretwin.orchestrator.commands.watch import watch as serve

    raise typer.Exit(serve(WatchRequest(run, out, listen, secure, operate, name)))
