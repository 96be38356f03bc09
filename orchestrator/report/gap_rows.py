"""The gap of a run by horizon and manoeuvre, from its table; and how far people differ."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from foretwin.sim_worker.analysis.gap.measured_motion import MANOEUVRES

ALL = "all"


class GapOf(NamedTuple):
    """RMS of the gap by quantity after one horizon, of one manoeuvre or of all together."""

    horizon_s: float
    manoeuvre: str
    runs: int
    independent: bool
    rms: Mapping[str, float]
    position_p95_m: float


class HumanRow(NamedTuple):
    """How far two drives are apart some seconds after a place that both passed at like speed."""

    horizon_s: float
    places: int
    along_m: float | None
    across_m: float | None
    speed_mps: float | None


def gaps_of(table: pa.Table | None) -> list[GapOf]:
    """Return the rows of a run's table of gaps by horizon and manoeuvre, each horizon first as a
    whole; none without a table."""
    if table is None:
        return []
    groups: dict[tuple[float, str], list[dict[str, Any]]] = defaultdict(list)
    for one in table.to_pylist():
        groups[one["horizon_s"], ALL].append(one)
        groups[one["horizon_s"], one["manoeuvre"]].append(one)
    order = (ALL, *MANOEUVRES)
    return [
        _gap_of(horizon_s, manoeuvre, groups[horizon_s, manoeuvre])
        for horizon_s, manoeuvre in sorted(groups, key=lambda key: (key[0], order.index(key[1])))
    ]


def _gap_of(horizon_s: float, manoeuvre: str, rows: list[dict[str, Any]]) -> GapOf:
    names = ("along_m", "across_m", "yaw_rad", "speed_mps")
    values = {name: np.array([one[name] for one in rows], dtype=np.float64) for name in names}
    values["position_m"] = np.hypot(values["along_m"], values["across_m"])
    return GapOf(
        horizon_s=horizon_s,
        manoeuvre=manoeuvre,
        runs=len(rows),
        independent=all(one["independent"] for one in rows),
        rms={name: float(np.sqrt(np.mean(v * v))) for name, v in values.items()},
        position_p95_m=float(np.percentile(values["position_m"], 95)),
    )
