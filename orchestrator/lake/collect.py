"""Takes runs into a lake, in steps each of which is there whole or not at all.

Files are staged, then the manifest names them, then they are published. A kill before the manifest
leaves what was there; after it, whoever collects next publishes the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake.manifest import (
    CollectedRun,
    LakeManifest,
    Partition,
    RowsOfRun,
    read_manifest,
    write_manifest,
)
from foretwin.orchestrator.lake.part_files import UncollectableError, widened, write_parts
from foretwin.orchestrator.lake.sources import RUNS, RunSource, SourceTables, source_of
from foretwin.orchestrator.lake.store import LakeStore
from foretwin.sim_worker.futures.columns import RESULT_SCHEMA_VERSION

STEP_BYTES = 256 << 20
"""Runs of about so many bytes of tables are taken in one step."""
_UNTIL_WRITTEN = 0.95
"""Of what a bar shows of a step, until all rows are read; to publish them is the rest."""
_NAMED_FIRST = "jobs", "road_users", "futures", "rounds"
"""Tables are published in this order, then the others, `runs` last: who finds a run there finds all
of it."""


class Collected(msgspec.Struct, kw_only=True):
    """What a collect did, by the runs' ids; `refused` in one line each."""

    added: list[str] = []
    replaced: list[str] = []
    there: list[str] = []
    """Runs that the lake held already, as they are."""
    refused: list[str] = []
    rows: int = 0
    """Rows that were added."""


def collect(
    store: LakeStore,
    folders: Sequence[Path],
    *,
    replace: bool = False,
    advance: Callable[..., None] = lambda *_, **__: None,
) -> Collected:
    """Take runs and sweeps into a lake; what it holds already changes nothing.

    `advance` counts a run, or `by` so many, once it is there; runs of one step are written
    together, table by table, and count by the share of their cells that are.

    With `replace` a run that has changed since takes the place of what was taken of it. Whatever a
    killed collect left is brought to its end first. Raises UserError where the lake cannot be
    written or another collects, OSError where a disk or store fails.
    """
    done = Collected()
    with store.held():
        manifest = read_manifest(store)
        finish(store, manifest)
        for step in _steps(_new(folders, manifest, done, replace=replace, advance=advance)):
            _take(store, manifest, step, done, advance)
    return done


def finish(store: LakeStore, manifest: LakeManifest) -> None:
    """Publish what is staged as the manifest has it, and remove what else is staged."""
    staged = sorted(store.staged(), key=_order)
    for name in staged:
        file = manifest.files.get(name)
        if file is not None and store.sha256(name, staged=True) == file.sha256:
            store.publish(name)
        else:
            store.forget_staged(name)


def damaged(store: LakeStore) -> list[str]:
    """Return the files of a lake that are not what the manifest says, each with why."""
    found = []
    for name, file in sorted(read_manifest(store).files.items()):
        try:
            if store.sha256(name) != file.sha256:
                found.append(f"{store.where}/{name}: is not what was written")
        except FileNotFoundError:
            found.append(f"{store.where}/{name}: is not there")
    return found


def _new(
    folders: Sequence[Path],
    manifest: LakeManifest,
    done: Collected,
    *,
    replace: bool,
    advance: Callable[..., None],
) -> Iterator[SourceTables]:
    """Yield what the lake lacks; the others are counted in `done`."""
    begun: dict[str, RunSource] = {}
    for folder in folders:
        advance(f"reading {folder.name}", by=0)
        try:
            source = source_of(folder)
            known = manifest.runs.get(source.run_id)
            before = begun.get(source.run_id)
            if (known and known.source_sha256 == source.sha256) or (
                before and before.sha256 == source.sha256
            ):
                done.there.append(source.run_id)
                advance(folder.name)
                continue
            if before is not None:
                raise UserError(f"{folder}: is called {source.run_id} as {before.folder} is")
            if known is not None and not replace:
                raise UserError(
                    f"{folder}: {source.run_id} was collected before, and is another one since: "
                    "--replace takes it in place of that"
                )
            yield SourceTables(source)
            begun[source.run_id] = source
        except (UserError, OSError) as error:
            done.refused.append(" ".join(str(error).split()))
            advance(folder.name)


def _steps(sources: Iterator[SourceTables]) -> Iterator[list[SourceTables]]:
    """Yield sources in groups of about `STEP_BYTES`."""
    step: list[SourceTables] = []
    step_bytes = 0
    for one in sources:
        step.append(one)
        step_bytes += one.size_bytes
        if step_bytes >= STEP_BYTES:
            yield step
            step, step_bytes = [], 0
    if step:
        yield step


def _take(
    store: LakeStore,
    manifest: LakeManifest,
    sources: list[SourceTables],
    done: Collected,
    advance: Callable[..., None],
) -> None:
    """Take runs in one step, without those whose rows turn out to be unreadable."""
    told = 0

    def tell(what: str, share: float) -> None:
        nonlocal told
        more = max(int(share * len(sources)) - told, 0)  # begun anew without one, it goes not back
        told += more
        advance(what, by=more)

    left = sorted(sources, key=lambda one: (one.partition, one.source.run_id))
    while left:
        try:
            after = _staged(store, manifest, left, tell)
            break
        except UncollectableError as error:
            done.refused.append(" ".join(str(error).split()))
            left = [one for one in left if one.source.run_id != error.run_id]
    else:
        tell("refused", 1.0)
        return
    store.renew()
    write_manifest(store, after)
    for one in left:
        replaced = one.source.run_id in manifest.runs
        (done.replaced if replaced else done.added).append(one.source.run_id)
        done.rows += sum(of.rows for of in after.runs[one.source.run_id].tables.values())
    manifest.runs, manifest.files, manifest.columns = after.runs, after.files, after.columns
    finish(store, manifest)
    tell("published", 1.0)


def _staged(
    store: LakeStore,
    manifest: LakeManifest,
    sources: list[SourceTables],
    tell: Callable[[str, float], None],
) -> LakeManifest:
    """Stage all files that change; returns the manifest as it is with them."""
    after = LakeManifest(
        runs=dict(manifest.runs), files=dict(manifest.files), columns=dict(manifest.columns)
    )
    without = {one.source.run_id for one in sources if one.source.run_id in manifest.runs}
    wanted: dict[tuple[str, Partition], list[SourceTables]] = {}
    for run_id in sorted(without):
        for table in manifest.runs[run_id].tables:
            wanted[table, manifest.runs[run_id].partition] = []
    for one in sources:
        for table in one.schemas:
            wanted.setdefault((table, one.partition), []).append(one)
            after.columns[table] = widened(after.columns.get(table, {}), one, table)
    tables: dict[str, dict[str, RowsOfRun]] = {one.source.run_id: {} for one in sources}
    cells = sum(one.rows[table] * len(one.schemas[table]) for one in sources for table in one.rows)
    taken = 0

    def took(table: str, more: int) -> None:
        nonlocal taken
        taken += more
        tell(table, _UNTIL_WRITTEN * taken / cells)

    for (table, partition), of in wanted.items():
        written = write_parts(
            store, after, f"{table}/{partition.path}", of, without=without, took=took
        )
        after.files |= written.files
        for one in of:
            names = tuple(name.rpartition("/")[2] for name in written.files_of[one.source.run_id])
            tables[one.source.run_id][table] = RowsOfRun(one.rows[table], names)
    for one in sources:
        after.runs[one.source.run_id] = CollectedRun(
            kind=one.source.kind,
            source_sha256=one.source.sha256,
            result_schema=RESULT_SCHEMA_VERSION,
            partition=one.partition,
            tables=dict(sorted(tables[one.source.run_id].items())),
        )
    return after


def _order(name: str) -> tuple[int, str]:
    table = name.partition("/")[0]
    if table in _NAMED_FIRST:
        return _NAMED_FIRST.index(table), name
    return len(_NAMED_FIRST) + (table == RUNS), name
