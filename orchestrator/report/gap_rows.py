"""The gap of a run by horizon and manoeuvre, from its table; and how far people differ."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import pyarrow as pa

from foretwin.contracts.gap import GapSample
from foretwin.sim_worker.analysis.gap.errors import GapRow, gap_table


class HumanRow(NamedTuple):
    """How far two drives are apart some seconds after a place that both passed at like speed."""

    horizon_s: float
    places: int
    along_m: float | None
    across_m: float | None
    speed_mps: float | None


def gaps_of(table: pa.Table | None) -> list[GapRow]:
    """Return the rows of a run's table of gaps by horizon and manoeuvre, each horizon first as a
    whole; none without a table.

    Runs by estimated commands count where there are no others: the rest were late or lost.
    """
    rows = [] if table is None else table.to_pylist()
    # A run's gaps are those of its own car, which the table does not repeat.
    samples = msgspec.convert([{"vehicle_id": "", **row} for row in rows], list[GapSample])
    commanded = [one for one in samples if one.independent]
    return gap_table(commanded or samples, also_all=True)
