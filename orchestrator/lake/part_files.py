"""Writes rows of one table and partition: onto the end of its last file until that is full."""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from typing import NamedTuple

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake.manifest import LakeFile, LakeManifest, part_name
from foretwin.orchestrator.lake.sources import RUN_ID, RUNS_SCHEMA, SourceTables
from foretwin.orchestrator.lake.store import HashedSink, LakeStore
from foretwin.orchestrator.record.results import TABLES
from foretwin.sim_worker.futures.checked_parquet import parquet_file, parquet_writer

PART_BYTES = 64 << 20
"""A file takes no more rows once it is so long; the last one of a partition is written anew with
every collect that adds to it."""
GROUP_BYTES, GROUP_ROWS = 16 << 20, 65536
"""Rows are written in groups of so many bytes in memory or so many rows."""


def _word(kind: pa.DataType) -> str:
    """Return a type in a word; Parquet has names of its own for the inside of maps."""
    return f"map<{kind.key_type}, {kind.item_type}>" if pa.types.is_map(kind) else str(kind)


_TYPES = {_word(field.type): field.type for of in (*TABLES.values(), RUNS_SCHEMA) for field in of}


class UncollectableError(UserError):
    """A run whose rows cannot be read or do not fit the lake."""

    def __init__(self, run_id: str, why: str) -> None:
        super().__init__(why)
        self.run_id = run_id


def widened(columns: Mapping[str, str], source: SourceTables, table: str) -> dict[str, str]:
    """Return the columns of a lake's table, with those that a run has besides.

    Raises UncollectableError where a column is of another type there.
    """
    wide = dict(columns)
    for field in source.schemas[table]:
        kind = _word(field.type)
        known = wide.setdefault(field.name, kind) if kind in _TYPES else f"one of {sorted(_TYPES)}"
        if known != kind:
            where = f"{source.source.folder}: {table}: column {field.name}"
            raise UncollectableError(
                source.source.run_id, f"{where} is {kind}, in the lake it is {known}"
            )
    return wide


class Written(NamedTuple):
    """Files of one table and partition as they are staged, and which hold rows of which run."""

    files: dict[str, LakeFile]
    files_of: dict[str, list[str]]


def write_parts(
    store: LakeStore,
    manifest: LakeManifest,
    folder: str,
    sources: Iterable[SourceTables],
    *,
    without: Collection[str] = (),
    took: Callable[[str, int], None] = lambda *_: None,
) -> Written:
    """Stage the files of a table and partition that change: the last one with the rows of sources
    after its own, and further ones; and those that hold runs which are to be taken out.

    `took` is told the table and how many more cells of sources were taken.

    Raises UncollectableError where rows of a source cannot be read, else OSError.
    """
    table = folder.partition("/")[0]
    schema = pa.schema([(name, _TYPES[kind]) for name, kind in manifest.columns[table].items()])
    there = manifest.parts(folder)
    leaving = [manifest.runs[run_id] for run_id in sorted(without)]
    touched = {
        f"{folder}/{file}"
        for run in leaving
        if f"{table}/{run.partition.path}" == folder and table in run.tables
        for file in run.tables[table].files
    }
    adding = list(sources)
    last = there[-1] if there else None
    grows = adding and last is not None and manifest.files[last].size_bytes < PART_BYTES
    staged = Written({}, {})
    for name in sorted(touched - ({last} if grows else set())):
        credited = _credited(schema, _credits(store, name))
        _write(store, staged, [name], credited, _rows_of_part(store, name, without))
    if adding:
        first = len(there) - bool(grows)
        names = (part_name(folder, number) for number in range(first, 100_000))
        before = last if grows else None
        named = _credits(store, before) | {source.attribution for source in adding}
        rows = _all_rows(store, before, adding, table, without, took)
        _write(store, staged, names, _credited(schema, named), rows)
    return staged


_Rows = Iterator[tuple[str | None, pa.RecordBatch]]
"""The run that is added, and its rows."""


def _credits(store: LakeStore, name: str | None) -> set[str]:
    """Return whose maps a file of a lake is made from."""
    if name is None:
        return set()
    with _opened(store, name) as file:
        told = (file.schema_arrow.metadata or {}).get(b"attribution", b"")
    return set(told.decode().split("; "))


def _credited(schema: pa.Schema, named: set[str]) -> pa.Schema:
    return schema.with_metadata({"attribution": "; ".join(sorted(named - {""}))})


@contextmanager
def _opened(store: LakeStore, name: str) -> Iterator[pq.ParquetFile]:
    try:
        with store.system.open_input_file(name) as source, parquet_file(source) as file:
            yield file
    except (OSError, pa.ArrowException) as error:
        why = " ".join(str(error).split())
        raise UserError(f"{store.where}/{name}: the lake is damaged there: {why}") from error


def _rows_of_part(store: LakeStore, name: str, without: Container[str]) -> _Rows:
    with _opened(store, name) as file:
        for batch in file.iter_batches():
            runs = batch.column(RUN_ID)
            gone = [run_id for run_id in pc.unique(runs).to_pylist() if run_id in without]
            stays = pc.invert(pc.is_in(runs, pa.array(gone, pa.string())))
            yield None, batch.filter(stays) if gone else batch


def _all_rows(
    store: LakeStore,
    last: str | None,
    adding: Iterable[SourceTables],
    table: str,
    without: Container[str],
    took: Callable[[str, int], None],
) -> _Rows:
    if last is not None:
        yield from _rows_of_part(store, last, without)
    for source in adding:
        run_id = source.source.run_id
        try:
            for batch in source.batches(table):
                yield run_id, batch
                took(table, batch.num_rows * batch.num_columns)
        except (UserError, FileNotFoundError) as error:
            raise UncollectableError(run_id, str(error)) from error


def _write(
    store: LakeStore, staged: Written, names: Iterable[str], schema: pa.Schema, rows: _Rows
) -> None:
    """Write rows into files of these names, the next one where one is full."""
    left = iter(names)
    with ExitStack() as held:
        part: _OpenPart | None = None
        for run_id, batch in rows:
            if part is None:
                part = held.enter_context(_OpenPart(store, next(left), schema, staged))
            if run_id is not None:
                part.runs.add(run_id)
            part.add(batch)
            if run_id is not None and part.full:  # what was there stays in its file
                held.pop_all().close()
                part = None


class _OpenPart:
    """One file while it is written."""

    def __init__(self, store: LakeStore, name: str, schema: pa.Schema, staged: Written) -> None:
        self.runs: set[str] = set()
        """Whose rows were added."""
        self._name, self._store, self._schema, self._staged = name, store, schema, staged
        self._waiting: list[pa.RecordBatch] = []
        self._waiting_bytes = self._waiting_rows = self._rows = 0
        self._held = ExitStack()

    def __enter__(self) -> _OpenPart:
        self._store.renew()
        self._sink: HashedSink = self._held.enter_context(self._store.staging(self._name))
        self._writer = parquet_writer(self._sink, self._schema)
        return self

    def __exit__(self, kind: type[BaseException] | None, *what: object) -> None:
        with self._held:
            if kind is not None:
                with suppress(Exception):
                    self._writer.close()
                return
            self._flush()
            self._writer.close()
        file = LakeFile(self._sink.sha256, self._sink.size_bytes, self._rows)
        self._staged.files[self._name] = file
        for run_id in self.runs:
            self._staged.files_of.setdefault(run_id, []).append(self._name)

    @property
    def full(self) -> bool:
        """Return whether it takes no more rows."""
        return self._sink.size_bytes >= PART_BYTES

    def add(self, batch: pa.RecordBatch) -> None:
        """Take rows; columns that they lack are null."""
        if not batch.num_rows:
            return
        there = set(batch.schema.names)
        filled = [
            batch.column(field.name).cast(field.type)
            if field.name in there
            else pa.nulls(batch.num_rows, field.type)
            for field in self._schema
        ]
        self._waiting.append(pa.RecordBatch.from_arrays(filled, schema=self._schema))
        self._waiting_bytes += batch.nbytes
        self._waiting_rows += batch.num_rows
        if self._waiting_bytes >= GROUP_BYTES or self._waiting_rows >= GROUP_ROWS:
            self._flush()

    def _flush(self) -> None:
        if self._waiting:
            self._writer.write_table(pa.Table.from_batches(self._waiting).combine_chunks())
            self._rows += self._waiting_rows
        self._waiting, self._waiting_bytes, self._waiting_rows = [], 0, 0
