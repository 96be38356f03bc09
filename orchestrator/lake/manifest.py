"""The manifest of a lake: which runs it holds, and which files, with their hashes."""

from __future__ import annotations

from itertools import count, takewhile
from urllib.parse import quote

import msgspec

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake.store import LakeStore

MANIFEST = "manifest.json"
LAKE_FORMAT = 1
"""Raised where files or columns of a lake mean something else."""
NONE = "none"
"""Stands for the vehicle of a sweep, and for its map where it has several. No null: who guesses the
types of partitions cannot do without a value."""


class Partition(msgspec.Struct, frozen=True, order=True):
    """What runs of one partition have in common, as words."""

    day: str
    """YYYY-MM-DD on which the drive began, by the clock of its computer, or the sweep ended."""
    vehicle: str
    map: str

    @property
    def path(self) -> str:
        """Return the folders of the partition, as Hive names them."""
        named = ("run_day", self.day), ("run_vehicle", self.vehicle), ("run_map", self.map)
        return "/".join(f"{key}={quote(value, safe='')}" for key, value in named)


class RowsOfRun(msgspec.Struct, frozen=True):
    """How many rows of a table are a run's, and in which of its partition's files they are."""

    rows: int
    files: tuple[str, ...]


class CollectedRun(msgspec.Struct, frozen=True, kw_only=True):
    """A run that is in the lake."""

    kind: str
    source_sha256: str
    result_schema: int
    partition: Partition
    tables: dict[str, RowsOfRun]
    """Those in which it has rows."""


class LakeFile(msgspec.Struct, frozen=True):
    """A file of a lake, as it is once it is published."""

    sha256: str
    size_bytes: int
    rows: int


class LakeManifest(msgspec.Struct, kw_only=True):
    """All that is in a lake, by the runs' ids and the files' names."""

    lake_format: int = LAKE_FORMAT
    runs: dict[str, CollectedRun] = {}
    files: dict[str, LakeFile] = {}
    columns: dict[str, dict[str, str]] = {}
    """The type of every column that a table has in any file, by table."""

    def parts(self, folder: str) -> list[str]:
        """Return the files of one table and partition, the oldest first."""
        names = (part_name(folder, number) for number in count())
        return list(takewhile(self.files.__contains__, names))


def part_name(folder: str, number: int) -> str:
    """Return the name of a file of a table and partition."""
    return f"{folder}/part-{number:05d}.parquet"


def read_manifest(store: LakeStore) -> LakeManifest:
    """Return what is in a lake, nothing where there is none yet.

    Raises UserError where it is none of ours, or of another foretwin.
    """
    data = store.read(MANIFEST)
    if data is None:
        return LakeManifest()
    try:
        told = msgspec.json.decode(data, type=_Format).lake_format
        if told != LAKE_FORMAT:
            raise UserError(
                f"{store.where}: a lake of another foretwin (format {told}; this one reads "
                f"{LAKE_FORMAT})"
            )
        return msgspec.json.decode(data, type=LakeManifest)
    except msgspec.DecodeError as error:
        raise UserError(f"{store.where}/{MANIFEST}: is no manifest of a lake: {error}") from error


def write_manifest(store: LakeStore, manifest: LakeManifest) -> None:
    """Write it in place of what is there: from then on the lake holds what it says."""
    inorder = msgspec.structs.replace(
        manifest,
        runs=dict(sorted(manifest.runs.items())),
        files=dict(sorted(manifest.files.items())),
    )
    store.write(MANIFEST, msgspec.json.encode(inorder) + b"\n")


class _Format(msgspec.Struct):
    lake_format: int
