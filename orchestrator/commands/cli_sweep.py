"""The options of `foretwin sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.contracts.numbers import FUTURE_NUMBERS


def sweep(
    spec: Annotated[
        Path,
        typer.Argument(
            help="what to sweep over, TOML; its table of parameters lists "
            + ", ".join(f"{name} ({row.range})" for name, row in FUTURE_NUMBERS.items())
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(help="folder of the rows [default: sweeps/SPEC]")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(help="worker processes [default: 2; with ray, every processor there is]"),
    ] = None,
    engine: Annotated[str, typer.Option(help="zenoh (this machine) or ray")] = "zenoh",
    address: Annotated[
        str | None,
        typer.Option(help="HOST:PORT of a Ray cluster, or auto [default: one of its own, here]"),
    ] = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="start anew, not where it stopped")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="the summary as JSON")] = False,
) -> None:
    """Play scenarios on junctions with planners and parameters, offline, into Parquet."""
    from foretwin.orchestrator.commands.sweep import sweep as run_sweep
    from foretwin.orchestrator.sweep.engines import Engine

    played_by = Engine(engine, workers, address)
    raise typer.Exit(run_sweep(spec, out=out, engine=played_by, fresh=fresh, as_json=as_json))
