"""The gap of a run by horizon and manoeuvre, from its table; and how far people differ."""

from __future__ import annotations

from typing import NamedTuple

import pyarrow as pa

from foretwin.orchestrator.record.gap_samples import gap_samples
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
    samples = gap_samples([] if table is None else table.to_pylist())
    commanded = [one for one in samples if one.independent]
    return gap_table(commanded or samples, also_all=True)
