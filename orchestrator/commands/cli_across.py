"""The command line of many runs at once: what each command takes. The work is imported when run."""

from __future__ import annotations

from typing import Annotated

import typer

JsonOption = Annotated[bool, typer.Option("--json", help="a JSON list, an object for each row")]
CsvOption = Annotated[bool, typer.Option("--csv", help="comma-separated values, with a header")]
PlacesArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[FOLDER]...",
        help="runs, sweeps, folders of these, or lakes [default: runs and sweeps, where they are]",
    ),
]


def runs(
    folders: PlacesArgument = None, as_json: JsonOption = False, as_csv: CsvOption = False
) -> None:
    """List runs and sweeps: when, what, how long, how they ended, what was found.

    Example: foretwin runs --json
    """
    from foretwin.orchestrator.commands.runs import list_runs

    list_runs(tuple(folders or ()), as_json=as_json, as_csv=as_csv)


def query(
    sql: Annotated[
        str | None,
        typer.Argument(metavar="[SQL]", help="one SELECT; without any, views and their columns"),
    ] = None,
    folders: PlacesArgument = None,
    as_json: JsonOption = False,
    as_csv: CsvOption = False,
) -> None:
    """Ask many runs and sweeps at once, in SQL (DuckDB): views runs, futures, rounds and more.

    Example: foretwin query "SELECT run, avg(collided::INT) FROM futures GROUP BY run" runs
    """
    from foretwin.orchestrator.commands.query import ask_runs

    ask_runs(sql, tuple(folders or ()), as_json=as_json, as_csv=as_csv)


ACROSS_RUNS = runs, query
"""In the order in which help lists them."""
