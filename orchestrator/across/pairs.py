"""The same case in two runs or sweeps: futures that differ in nothing but what is compared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow.compute as pc

from foretwin.contracts.errors import UserError
from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.orchestrator.across.places import FoundRuns
from foretwin.orchestrator.across.run_rows import DRIVE, SWEEP, RunRow, row_of_folder
from foretwin.orchestrator.across.tables import RunTables
from foretwin.orchestrator.record.run_state import check_finished

_CASE = {
    SWEEP: ("junction_id", "place", "scenario", "case", "seed", *FUTURE_NUMBERS),
    DRIVE: ("junction_id", "stamp_ns", "index", "scenario", "name"),
}
"""What two futures have in common that are the same case, besides who drives what."""
_DRIVEN = {SWEEP: ("planner", "vehicle"), DRIVE: ("planner",)}
"""What they have in common too, unless each side has a single one: then these are compared."""


class ComparedSide(NamedTuple):
    """One side: the row of its run, its record, its futures, and which of its metrics mean what."""

    row: RunRow
    futures: list[dict[str, Any]]
    better: dict[str, str]
    """Which direction is better, of a metric: lower, higher or neither."""
    units: dict[str, str]

    @property
    def planners(self) -> list[str]:
        """Return who drives in its futures."""
        return self.names_of("planner")

    def names_of(self, column: str) -> list[str]:
        """Return what its futures have in a column of names."""
        return sorted({row[column] for row in self.futures})


class Paired(NamedTuple):
    """Futures of the same cases, side by side, and how many have none on the other."""

    pairs: list[tuple[dict[str, Any], dict[str, Any]]]
    only_first: int
    only_second: int


def side_of(folder: Path, planner: str | None) -> ComparedSide:
    """Read one side, of one planner where it is named.

    Raises UserError in one line for a run that has not ended, is damaged, or holds no such futures.
    """
    check_finished(folder)
    row = row_of_folder(folder)
    wrong: list[str] = []
    tables = RunTables(FoundRuns([row], [], []), wrong.append)
    found = [source.rows.to_table() for source in tables.sources("futures")]
    if wrong or not found:
        raise UserError(wrong[0] if wrong else f"{folder}: holds no table of futures")
    futures = found[0]
    if planner is not None:
        known = sorted(set(futures["planner"].to_pylist()))
        if planner not in known:
            raise UserError(f"{folder}: no futures of planner {planner!r}: has {', '.join(known)}")
        futures = futures.filter(pc.equal(futures["planner"], planner))
    meaning = [one for of in tables.sources("metrics") for one in of.rows.to_table().to_pylist()]
    return ComparedSide(
        row,
        futures.to_pylist(),
        {one["name"]: one["better"] for one in meaning},
        {one["name"]: one["unit"] for one in meaning},
    )


def paired(first: ComparedSide, second: ComparedSide) -> Paired:
    """Return the futures of both sides that are the same case, ordered by it.

    By planner and, of sweeps, vehicle too, unless each side has a single one.
    """
    kind, sides = first.row.kind, (first, second)
    apart = (one for one in _DRIVEN[kind] if any(len(side.names_of(one)) > 1 for side in sides))
    names = (*_CASE[kind], *apart)
    others = _by_case(second.futures, names)
    mine = _by_case(first.futures, names)
    # In one order, whatever that of the rows: what is drawn by chance then says the same again.
    cases = sorted(mine.keys() & others.keys(), key=lambda case: [(v is not None, v) for v in case])
    pairs = [(mine[case], others[case]) for case in cases]
    return Paired(pairs, len(mine) - len(pairs), len(others) - len(pairs))


def _by_case(
    futures: Sequence[dict[str, Any]], names: Sequence[str]
) -> dict[tuple[Any, ...], dict[str, Any]]:
    """Return futures by their case; of equal ones the first belongs to the first, and so on."""
    seen: Counter[tuple[Any, ...]] = Counter()
    found = {}
    for row in futures:
        case = tuple(row.get(name) for name in names)
        found[*case, seen[case]] = row
        seen[case] += 1
    return found
