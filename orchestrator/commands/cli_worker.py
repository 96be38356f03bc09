"""The command line of a worker on another machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.orchestrator.commands.cli_options import InsecureOption


def worker(
    connect: Annotated[str, typer.Option(help="where the drive listens, tls/HOST:PORT")],
    secure: Annotated[
        Path | None,
        typer.Option(help="this machine's certificate: the folder worker-NAME of the campaign"),
    ] = None,
    insecure: InsecureOption = False,
    name: Annotated[
        str | None,
        typer.Option(help="what this machine is called [default: as its certificate says]"),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="worker processes [default: one a processor]")
    ] = None,
    cache: Annotated[
        Path | None, typer.Option(help="folder of Worlds [default: the user's cache]")
    ] = None,
    stay: Annotated[
        bool, typer.Option("--stay", help="wait for a drive, and after it for the next")
    ] = False,
) -> None:
    """Play futures for a drive on another machine (docs/workers.md).

    Goes on until the drive is over, or Ctrl-C: there is no result, and no --json.

    Example: foretwin worker --connect tls/192.168.7.2:7447 --secure worker-boot
    """
    from foretwin.orchestrator.commands.worker import WorkerRequest, work

    raise typer.Exit(work(WorkerRequest(connect, secure, insecure, name, workers, cache, stay)))
