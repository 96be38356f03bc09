"""The command `runs`: what lies in folders of runs and sweeps, and in lakes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from foretwin.contracts.terminal import console, say
from foretwin.orchestrator.across.places import by_time, found_in
from foretwin.orchestrator.across.run_rows import DAMAGED, KILLED, RunRow
from foretwin.orchestrator.across.table_heads import not_whole
from foretwin.orchestrator.across.tables import lake_rows
from foretwin.orchestrator.commands.output import print_csv, print_table
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.record.folders_of_runs import table_files
from foretwin.orchestrator.record.run_state import RUNNING

_LEFT_OUT = "record"
"""Too long for a list: `foretwin query` has it."""
WIDE = 120
_WHERE_WIDE = frozenset({"when", "junctions", "futures"})
"""Columns that narrower terminals leave out; the id of a drive says when."""


def list_runs(places: Sequence[str], *, as_csv: bool) -> CommandResult:
    """Return a row for each run, in the order of time; what is wrong with one stands in its row.

    Raises FileNotFoundError or UserError where there is none.
    """
    found = found_in(places)
    rows = [_looked_into(row) for row in found.rows]
    for lake in found.lakes:
        there = {row.run for row in rows}
        rows += [row for row in lake_rows(lake) if row.run not in there]
    rows.sort(key=by_time)
    told = [_told(row) for row in rows]
    if as_csv:
        return CommandResult(
            told, lambda: print_csv(list(told[0]), [list(one.values()) for one in told])
        )
    return CommandResult(told, lambda: _print(rows))


def _looked_into(row: RunRow) -> RunRow:
    """Return the row of a run as damaged where a file of its tables is cut short."""
    if row.state in (DAMAGED, RUNNING):
        return row
    files = table_files(Path(row.folder))
    if wrong := not_whole(path for paths in files.values() for path in paths):
        return msgspec.structs.replace(row, state=DAMAGED, remark=wrong)
    if not files and row.state != KILLED:
        return msgspec.structs.replace(row, state=DAMAGED, remark="holds no tables of results")
    return row


def _told(row: RunRow) -> dict[str, object]:
    return {name: value for name, value in msgspec.structs.asdict(row).items() if name != _LEFT_OUT}


def _print(rows: Sequence[RunRow]) -> None:
    from rich.table import Column

    cells: dict[str, tuple[Column, Callable[[RunRow], object]]] = {
        "run": (Column("run", no_wrap=True), lambda row: row.run),
        "when": (Column("when", no_wrap=True), lambda row: (row.time or "")[:16]),
        "what": (Column("what", overflow="fold"), _what),
        "lasted": (Column("lasted", justify="right", no_wrap=True), _lasted),
        "junctions": (Column("junctions", justify="right"), lambda row: _count(row.junctions)),
        "futures": (Column("futures", justify="right"), lambda row: _count(row.futures)),
        "state": (Column("state", no_wrap=True), lambda row: row.state),
        "verdict": (Column("verdict", overflow="fold"), _found),
    }
    narrow = console().width < WIDE
    shown = [cells[name] for name in cells if not (narrow and name in _WHERE_WIDE)]
    table = [[str(cell(row)) for _, cell in shown] for row in rows]
    print_table("runs and sweeps", [column for column, _ in shown], table)
    for row in rows:
        if row.remark:
            say(f"{row.run}: {row.remark}", error=True)


def _count(number: int | None) -> str:
    return "" if number is None else str(number)


def _what(row: RunRow) -> str:
    on = f" on {row.map}" if row.map else ""
    by = f", {row.planner}" if row.planner else ""
    return f"{row.what}{on}{by}"


def _lasted(row: RunRow) -> str:
    lasted_s = row.wall_s if row.driven_s is None else row.driven_s
    if lasted_s is None:
        return ""
    minutes, seconds = divmod(round(lasted_s), 60)
    return f"{minutes}:{seconds:02d} min" if minutes else f"{lasted_s:.1f} s"


def _found(row: RunRow) -> str:
    troubles = f"{row.troubles} troubles" if row.troubles else ""
    return "; ".join(part for part in (row.verdict or "", troubles) if part)
