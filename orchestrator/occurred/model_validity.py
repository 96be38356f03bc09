"""Whether the model of the car held while a scenario took place, by the drive's own gaps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.gap import ALARM_HORIZON_S, GapSample
from foretwin.orchestrator.record.gap_samples import gap_samples
from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario

_AROUND_NS = 1_000_000_000


class ModelGap(msgspec.Struct, frozen=True, kw_only=True):
    """The gap at the horizon of alarms in one scenario's time, `samples` of it; none where 0.

    Medians and 95th percentiles of |model - reality|; `within_limits` where none is beyond those of
    alarms, None without a sample. `independent` is false where the model was driven by commands
    that were estimated from the same motion: then it says little.
    """

    samples: int = 0
    along_p50_m: float | None = None
    along_p95_m: float | None = None
    across_p50_m: float | None = None
    across_p95_m: float | None = None
    speed_p95_mps: float | None = None
    within_limits: bool | None = None
    independent: bool = False


def model_gaps(
    scenarios: Sequence[OccurredScenario], rows: Iterable[Mapping[str, Any]]
) -> tuple[ModelGap, ...]:
    """Return the gap of each scenario's time, a second around it included."""
    told = [one for one in gap_samples(rows) if abs(one.horizon_s - ALARM_HORIZON_S) < 1e-6]
    stamps = np.array([one.stamp_ns for one in told], dtype=np.int64)
    return tuple(
        _gap(
            [
                told[k]
                for k in np.flatnonzero(
                    (stamps >= one.begin_ns - _AROUND_NS) & (stamps <= one.end_ns + _AROUND_NS)
                ).tolist()
            ]
        )
        for one in scenarios
    )


def _gap(samples: Sequence[GapSample]) -> ModelGap:
    if not samples:
        return ModelGap()
    along, across, speed = np.abs([(one.along_m, one.across_m, one.speed_mps) for one in samples]).T
    return ModelGap(
        samples=len(samples),
        along_p50_m=float(np.median(along)),
        along_p95_m=float(np.percentile(along, 95)),
        across_p50_m=float(np.median(across)),
        across_p95_m=float(np.percentile(across, 95)),
        speed_p95_mps=float(np.percentile(speed, 95)),
        within_limits=not any(one.beyond_limits for one in samples),
        independent=all(one.independent for one in samples),
    )
