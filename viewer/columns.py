"""Many rows of one entity sent as columns: one call instead of one for each instant."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr

from foretwin.viewer.rows import TIMELINE, Row


class _ComponentCells(NamedTuple):
    """One component of several rows on end."""

    arrays: list[pa.Array]

    def as_arrow_array(self) -> pa.Array:
        return pa.concat_arrays(self.arrays)


def send_rows(stream: rr.RecordingStream, path: str, rows: Sequence[Row]) -> None:
    """Send timed rows of the entity at `path`, in their order."""
    for times_ns, columns in _tables(rows):
        rr.send_columns(
            path,
            indexes=[rr.TimeColumn(TIMELINE, duration=np.array(times_ns, dtype="timedelta64[ns]"))],
            columns=[
                rr.ComponentColumn(descriptor, cells, lengths=[len(a) for a in cells.arrays])
                for descriptor, cells in columns.items()
            ],
            recording=stream,
        )


def _tables(
    rows: Sequence[Row],
) -> Iterator[tuple[list[int], dict[rr.ComponentDescriptor, _ComponentCells]]]:
    """Yield stretches of rows that say the same components: instants, and a column of each."""
    times_ns: list[int] = []
    columns: dict[rr.ComponentDescriptor, _ComponentCells] = {}
    for row in rows:
        assert row.drive_ns is not None
        said = {
            batch.component_descriptor(): batch.as_arrow_array()
            for batch in row.components.as_component_batches()
        }
        if times_ns and said.keys() != columns.keys():
            yield times_ns, columns
            times_ns, columns = [], {}
        times_ns.append(row.drive_ns)
        for descriptor, array in said.items():
            columns.setdefault(descriptor, _ComponentCells([])).arrays.append(array)
    if times_ns:
        yield times_ns, columns
