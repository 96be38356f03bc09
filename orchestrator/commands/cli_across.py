"""The command line of many runs at once: what each command takes. The work is imported when run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.commands.cli_options import (
    FirstDeclarationOption,
    OtherDeclarationOption,
)
from foretwin.orchestrator.commands.told import CommandResult, told

CsvOption = Annotated[bool, typer.Option("--csv", help="comma-separated values, with a header")]
PlacesArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[FOLDER]...",
        help="runs, sweeps, folders of these, or lakes [default: runs and sweeps, where they are]",
    ),
]


@told
def runs(folders: PlacesArgument = None, as_csv: CsvOption = False) -> CommandResult:
    """List runs and sweeps: when, what, how long, how they ended, what was found.

    Example: foretwin runs --json
    """
    from foretwin.orchestrator.commands.runs import list_runs

    return list_runs(tuple(folders or ()), as_csv=as_csv)


@told
def query(
    sql: Annotated[
        str | None,
        typer.Argument(metavar="[SQL]", help="one SELECT; without any, views and their columns"),
    ] = None,
    folders: PlacesArgument = None,
    as_csv: CsvOption = False,
) -> CommandResult:
    """Ask many runs and sweeps at once, in SQL (DuckDB): views runs, futures, rounds and more.

    Example: foretwin query "FROM rounds WHERE late" runs
    """
    from foretwin.orchestrator.commands.query import ask_runs

    return ask_runs(sql, tuple(folders or ()), as_csv=as_csv)


@told
def compare(
    first: Annotated[Path, typer.Argument(metavar="A", help="run or sweep; or recorded drive")],
    second: Annotated[
        Path, typer.Argument(metavar="B", help="another; or a drive of the same road, or A again")
    ],
    planners: Annotated[
        str | None, typer.Option(help="runs, sweeps: A,B: compare one planner with another")
    ] = None,
    fail_on_worse: Annotated[
        bool,
        typer.Option(
            "--fail-on-worse",
            help="runs, sweeps: exit code 3 where more cases newly fail than were fixed",
        ),
    ] = False,
    every: Annotated[
        bool,
        typer.Option("--all", help="runs, sweeps: every measure that changed, were it by chance"),
    ] = False,
    out: Annotated[Path | None, typer.Option(help="drives: folder for a picture")] = None,
    declaration: FirstDeclarationOption = None,
    other_declaration: OtherDeclarationOption = None,
) -> CommandResult:
    """Compare two runs, sweeps or planners: what changed; or two drives of one road, as recorded.

    Example: foretwin compare sweeps/before sweeps/after --fail-on-worse
    """
    from foretwin.orchestrator.record.folders_of_runs import is_run_folder

    if is_run_folder(first) or is_run_folder(second):
        from foretwin.orchestrator.commands.compare_runs import compare_runs, refuse_for_runs

        refuse_for_runs(first, second, of_drives=(out, declaration, other_declaration))
        return compare_runs(
            first,
            second,
            planners=planners,
            every=every,
            fail_on_worse=fail_on_worse,
        )
    if planners is not None or fail_on_worse or every:
        raise UserError(
            f"{first}, {second}: --planners, --fail-on-worse and --all are for runs or sweeps"
        )
    from foretwin.orchestrator.commands.compare import compare as compare_drives

    return compare_drives(
        first,
        second,
        out=out,
        declaration=declaration,
        other_declaration=other_declaration,
    )


ACROSS_RUNS = runs, query
"""In the order in which help lists them."""
