"""Where a lake lies: a folder or an object store, and who may write there."""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.fs as pafs

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.record.durable import sync_folder, whole_file
from foretwin.orchestrator.sweep.lock import folder_lock

STAGED, CLAIMS = "_staged", "_collecting"
"""Folders that readers of a lake pass by: what is not published yet, and who collects."""
LOCK = "collect.lock"
"""In a lake that is a folder, from its first moment on."""
CLAIM_S = 600.0
"""After so long without a word who collects into an object store is held for dead."""
RENEWED_S = 60.0
"""How often who collects says that it still does."""


def store_at(where: str) -> LakeStore:
    """Return the store of a folder, or of s3://BUCKET/PREFIX or gs://BUCKET/PREFIX.

    Raises UserError where it is neither.
    """
    if "://" not in where:
        return FolderStore(Path(where))
    try:
        system, path = pafs.FileSystem.from_uri(where)
    except (pa.ArrowException, OSError, ValueError) as error:
        why = " ".join(str(error).split())
        raise UserError(
            f"--into {where}: neither a folder nor s3://BUCKET/PREFIX nor gs://BUCKET/PREFIX: {why}"
        ) from error
    if isinstance(system, pafs.LocalFileSystem):
        return FolderStore(Path(path))
    return ObjectStore(where, pafs.SubTreeFileSystem(path, system))


class LakeStore:
    """Files of a lake by their names below its root; all raise OSError."""

    def __init__(self, where: str, system: pafs.FileSystem) -> None:
        self.where = where
        self.system = system

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the lake as the one who writes there; UserError where another does."""
        raise NotImplementedError

    def renew(self) -> None:
        """Say that this process still collects; UserError where it was held for dead."""

    def read(self, name: str) -> bytes | None:
        """Return what a file holds, None where it is not there."""
        try:
            with self.system.open_input_stream(name, compression=None) as source:
                data: bytes = source.read()
                return data
        except FileNotFoundError:
            return None

    def sha256(self, name: str, *, staged: bool = False) -> str:
        """Return the hash of a file."""
        name = f"{STAGED}/{name}" if staged else name
        digest = hashlib.sha256()
        with self.system.open_input_stream(name, compression=None) as source:
            while data := source.read(1 << 20):
                digest.update(data)
        return digest.hexdigest()

    def write(self, name: str, data: bytes) -> None:
        """Write a file in place of what was there, whole or not at all."""
        with self.system.open_output_stream(name, compression=None) as sink:
            sink.write(data)

    @contextmanager
    def staging(self, name: str) -> Iterator[HashedSink]:
        """Give what writes a file that `publish` will put at `name`; then it is on the disk."""
        with self.system.open_output_stream(f"{STAGED}/{name}", compression=None) as stream:
            yield HashedSink(stream)

    def publish(self, name: str) -> None:
        """Put a staged file where readers find it, in place of what was there."""
        self.system.move(f"{STAGED}/{name}", name)

    def staged(self) -> list[str]:
        """Return the names of what is staged."""
        return [one.path.removeprefix(f"{STAGED}/") for one in self._files(STAGED)]

    def forget_staged(self, name: str) -> None:
        """Remove what is staged under a name."""
        self.system.delete_file(f"{STAGED}/{name}")

    def _files(self, folder: str) -> list[pafs.FileInfo]:
        chosen = pafs.FileSelector(folder, recursive=True, allow_not_found=True)
        found = self.system.get_file_info(chosen)
        return sorted((one for one in found if one.is_file), key=lambda one: one.path)


class FolderStore(LakeStore):
    """A lake in a folder: what is written is on the disk before it counts."""

    def __init__(self, folder: Path) -> None:
        super().__init__(str(folder), pafs.SubTreeFileSystem(str(folder), pafs.LocalFileSystem()))
        self._folder = folder

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the folder's lock, which ends with the process."""
        if self._folder.exists() and not self._folder.is_dir():
            raise UserError(f"--into {self.where}: is a file; a lake is a folder")
        there = {one.name for one in self._folder.iterdir()} if self._folder.exists() else set()
        if there and LOCK not in there:
            raise UserError(f"--into {self.where}: holds other files and no lake")
        self._folder.mkdir(parents=True, exist_ok=True)
        with folder_lock(self._folder, name=LOCK, option="--into", who="collect"):
            yield

    def write(self, name: str, data: bytes) -> None:
        """Write it under another name first."""
        with whole_file(self._folder / name) as partial:
            partial.write_bytes(data)
        sync_folder(self._folder)

    @contextmanager
    def staging(self, name: str) -> Iterator[HashedSink]:
        """Write into a file of the folder, and sync it."""
        path = self._folder / STAGED / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            yield HashedSink(file)
            file.flush()
            os.fsync(file.fileno())

    def publish(self, name: str) -> None:
        """Rename it: who reads sees the file before or after."""
        target = self._folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (self._folder / STAGED / name).replace(target)
        sync_folder(target.parent)


class ObjectStore(LakeStore):
    """A lake in an object store: whoever collects leaves a claim there and looks for others.

    Listings must tell what was written before, as those of S3 and GCS do: of two who claim at once
    at least one sees the other, and who sees another gives way.
    """

    def __init__(self, where: str, system: pafs.FileSystem) -> None:
        super().__init__(where, system)
        self._claim = f"{CLAIMS}/{uuid.uuid4().hex}"
        self.renewed_s = time.monotonic()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold a claim; one that nobody renewed for 10 minutes, by the store's clock, is dead."""
        self.write(self._claim, b"")
        try:
            self._give_way_to_others()
            yield
        finally:
            self.forget_claim()

    def renew(self) -> None:
        """Write the claim anew where it is time to."""
        now_s = time.monotonic()
        if now_s - self.renewed_s < RENEWED_S:
            return
        if self.read(self._claim) is None:
            raise UserError(f"--into {self.where}: was too slow: another collect took over")
        self.write(self._claim, b"")
        self.renewed_s = now_s

    def forget_claim(self) -> None:
        """Let others collect."""
        with contextlib.suppress(OSError):
            self.system.delete_file(self._claim)

    def _give_way_to_others(self) -> None:
        claims = {one.path: one.mtime for one in self._files(CLAIMS)}
        mine = claims.pop(self._claim)
        for path, renewed in claims.items():
            if (mine - renewed).total_seconds() < CLAIM_S:
                raise UserError(
                    f"--into {self.where}: another collect writes there, or was killed less than "
                    f"{CLAIM_S / 60.0:.0f} min ago"
                )
            self.system.delete_file(path)


class HashedSink:
    """A file that Arrow writes to, and the hash and length of what it wrote."""

    def __init__(self, stream: Any) -> None:
        self._stream, self._digest = stream, hashlib.sha256()
        self.size_bytes = 0
        self.closed = False

    @property
    def sha256(self) -> str:
        """Return the hash of what was written so far."""
        return self._digest.hexdigest()

    def write(self, data: Any) -> int:
        """Write bytes."""
        view = memoryview(data)
        self._stream.write(view)
        self._digest.update(view)
        self.size_bytes += view.nbytes
        return view.nbytes

    def tell(self) -> int:
        """Return how much was written."""
        return self.size_bytes

    def flush(self) -> None:
        """Do nothing: whoever opened the file brings it to the disk."""

    def close(self) -> None:
        """End writing; whoever opened the file closes it."""
        self.closed = True
