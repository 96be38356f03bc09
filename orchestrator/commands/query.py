"""The command `query`: many runs and sweeps asked at once, in SQL."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import console, say
from foretwin.orchestrator.across.database import AskedRows, ask, columns_in
from foretwin.orchestrator.across.places import FoundRuns, found_in
from foretwin.orchestrator.across.plain_cells import csv_cell, json_cell
from foretwin.orchestrator.across.tables import RunTables
from foretwin.orchestrator.commands.output import print_csv, print_table
from foretwin.orchestrator.commands.told import CommandResult

MOST_SHOWN = 200
"""Rows of an answer as a table; --json and --csv give all."""
LEAST_WIDTH = 9
"""Of a column, in characters."""


def ask_runs(sql: str | None, places: Sequence[str], *, as_csv: bool) -> CommandResult:
    """Return what a question in SQL comes to; without one, the views and their columns.

    Raises UserError in one line where the SQL is wrong, or nothing is found to ask.
    """
    try:
        found = found_in(places)
    except (UserError, FileNotFoundError):
        if sql is not None or places:
            raise
        answer = _views_of_any()
    else:
        tables = RunTables(found, lambda line: say(f"foretwin: {line}", error=True))
        answer = _rows_of(columns_in(tables, tables.names)) if sql is None else ask(tables, sql)
    return CommandResult(lambda: _objects(answer), lambda: _print(answer, as_csv=as_csv))


def _objects(answer: AskedRows) -> list[dict[str, Any]]:
    return [
        {name: json_cell(cell) for name, cell in zip(answer.columns, row, strict=True)}
        for row in answer.rows
    ]


def _print(answer: AskedRows, *, as_csv: bool) -> None:
    if as_csv:
        print_csv(answer.columns, ([csv_cell(cell) for cell in row] for row in answer.rows))
        return
    fit = max(console().width // LEAST_WIDTH, 1)
    shown = [[_text(cell) for cell in row[:fit]] for row in answer.rows[:MOST_SHOWN]]
    print_table("", answer.columns[:fit], shown)
    if len(answer.columns) > fit:
        count = f"{fit} of {len(answer.columns)} columns"
        say(f"{count} fit here; --csv and --json give all", error=True)
    if len(answer.rows) > MOST_SHOWN:
        say(f"{MOST_SHOWN} of {len(answer.rows)} rows; --csv and --json give all", error=True)


def _views_of_any() -> AskedRows:
    """Return the views that runs have; no run is here."""
    from foretwin.orchestrator.record.results import TABLES  # takes a second, and is seldom wanted

    tables = RunTables(FoundRuns([], [], []), lambda line: None)
    say("foretwin: no runs are here; these are the views of any run", error=True)
    return _rows_of(columns_in(tables, sorted({*tables.names, *TABLES})))


def _rows_of(columns: Mapping[str, Mapping[str, str]]) -> AskedRows:
    return AskedRows(
        ["view", "column", "type"],
        [(view, name, kind) for view, of in columns.items() for name, kind in of.items()],
    )


def _text(cell: Any) -> str:
    if isinstance(cell, float):
        return f"{cell:.6g}"
    if isinstance(cell, bytes):
        return f"{len(cell)} bytes"
    return "" if cell is None else str(csv_cell(cell))
