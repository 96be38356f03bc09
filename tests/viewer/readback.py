"""What a recording holds, read back from the file."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader


class Recorded:
    """All rows of a recording by entity path; also of a file cut off by a kill."""

    def __init__(self, path: Path) -> None:
        self._chunks: dict[str, list[Any]] = {}
        with warnings.catch_warnings():
            # A recording that is still being written, or was cut off, has no footer yet.
            warnings.filterwarnings("ignore", message="RRD file has no footer")
            chunks = RrdReader(path).stream().to_chunks()
        for chunk in chunks:
            self._chunks.setdefault(str(chunk.entity_path), []).append(chunk)

    @property
    def paths(self) -> set[str]:
        return set(self._chunks)

    def times_s(self, path: str) -> np.ndarray[Any, Any]:
        """Return the drive times of an entity's rows in seconds."""
        columns = [
            chunk.to_record_batch().column("drive_time").cast("int64").to_numpy()
            for chunk in self._chunks.get(path, [])
            if not chunk.is_static
        ]
        return np.sort(np.concatenate(columns)) / 1e9 if columns else np.empty(0)

    def values(self, path: str, component: str) -> list[Any]:
        """Return the values of the column whose name ends in `component`, in the file's order."""
        found: list[Any] = []
        for chunk in self._chunks.get(path, []):
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if name.endswith(component):
                    found += batch.column(name).to_pylist()
        return found
