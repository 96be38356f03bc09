"""Where runs are looked for: folders of runs and sweeps, and lakes of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.across.run_rows import RunRow, row_of_folder
from foretwin.orchestrator.lake.manifest import MANIFEST, LakeManifest, read_manifest
from foretwin.orchestrator.lake.store import LakeStore, store_at
from foretwin.orchestrator.record.folders_of_runs import folders_of_runs

USUAL = "runs", "sweeps"
"""Where drives and sweeps are written where nothing else is said."""


class FoundLake(NamedTuple):
    """A lake, and what is in it."""

    store: LakeStore
    manifest: LakeManifest


class FoundRuns(NamedTuple):
    """Rows of runs in folders, each run once, and the lakes beside them."""

    rows: list[RunRow]
    lakes: list[FoundLake]
    doubled: list[str]
    """What is there twice, in a line each: only the first counts."""


def found_in(given: Sequence[str]) -> FoundRuns:
    """Return the runs and sweeps of folders, of folders of these, and lakes.

    Without any, `runs` and `sweeps` where one is. Raises FileNotFoundError or UserError where
    nothing is found.
    """
    places = list(given) or [name for name in USUAL if Path(name).is_dir()]
    if not places:
        raise UserError("name a folder of runs, or a lake: neither runs nor sweeps is here")
    found = FoundRuns([], [], [])
    seen: dict[str, str] = {}
    for place in places:
        lake = _lake_at(place)
        if lake is not None:
            found.lakes.append(lake)
            continue
        for folder in folders_of_runs(Path(place)):
            row = row_of_folder(folder)
            first = seen.get(row.run)
            if first is None:
                seen[row.run] = row.folder
                found.rows.append(row)
            elif Path(first).resolve() != folder.resolve():
                same = f"is called {row.run} as {first} is: only the first is asked"
                found.doubled.append(f"{row.folder}: {same}")
                remark = f"called as {first} is"
                found.rows.append(msgspec.structs.replace(row, remark=remark))
    found.rows.sort(key=by_time)
    return found


def once(rows: Sequence[RunRow]) -> Iterator[RunRow]:
    """Yield the first row of each run."""
    seen: set[str] = set()
    for row in rows:
        if row.run not in seen:
            seen.add(row.run)
            yield row


def by_time(row: RunRow) -> tuple[str, str]:
    """Return what runs are listed by."""
    return row.time or "", row.run


def _lake_at(place: str) -> FoundLake | None:
    if "://" not in place and not (Path(place) / MANIFEST).is_file():
        return None
    store = store_at(place)
    try:
        manifest = read_manifest(store)
    except OSError as error:
        raise UserError(f"{place}: {' '.join(str(error).split())}") from error
    if not manifest.runs:
        raise UserError(f"{place}: no lake is there")
    return FoundLake(store, manifest)
