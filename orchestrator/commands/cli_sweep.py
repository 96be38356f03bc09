"""The options of `foretwin sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.contracts.errors import UserError
from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.orchestrator.commands.told import CommandResult, told


@told
def sweep(
    specs: Annotated[
        list[Path],
        typer.Argument(
            metavar="SPEC",
            help="what to sweep over, TOML (with --merge the folders of shards); its table of "
            "parameters lists "
            + ", ".join(f"{name} ({row.range})" for name, row in FUTURE_NUMBERS.items()),
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
    shard: Annotated[
        str | None,
        typer.Option(metavar="I/N", help="only one of N parts, I from 0 to N - 1"),
    ] = None,
    merge: Annotated[
        bool, typer.Option("--merge", help="put the folders of all shards together into --out")
    ] = False,
) -> CommandResult:
    """Play scenarios on junctions with planners and parameters, offline, into Parquet.

    Example: foretwin sweep SPEC.toml --workers 4
    """
    from foretwin.orchestrator.commands.sweep import merge_shards
    from foretwin.orchestrator.commands.sweep import sweep as run_sweep
    from foretwin.orchestrator.sweep.engines import Engine

    if merge:
        for_playing = {
            "--shard": shard,
            "--workers": workers,
            "--engine": None if engine == "zenoh" else engine,
            "--address": address,
            "--fresh": "" if fresh else None,
        }
        for option, value in for_playing.items():
            if value is not None:
                said = f"{option} {value}".rstrip()
                raise UserError(f"{said}: goes with a SPEC, not with --merge")
        return merge_shards(specs, out=out)
    if len(specs) != 1:
        raise UserError("sweep takes one SPEC; --merge takes the folders of shards")
    return run_sweep(
        specs[0],
        out=out,
        engine=Engine(engine, workers, address),
        fresh=fresh,
        shard=shard,
    )
