"""A live round from its state to its last result, against the processor time of its jobs."""

from __future__ import annotations

from tests.benchmarks.live_drive import live_drive
from tests.benchmarks.measuring import Measurement


def measure() -> Measurement:
    """Return the median, against the sum of a round's jobs, which two workers share.

    On two idle cores the ratio is little above a half; `slowest_job_cpu_ms` is the least there.
    """
    found = live_drive()
    return Measurement(
        found.wall_ms,
        "ms",
        found.jobs_cpu_ms,
        {
            "cpu_ms": found.jobs_cpu_ms + found.orchestrator_cpu_ms,
            "slowest_job_cpu_ms": found.slowest_job_cpu_ms,
            "p95_ms": found.p95_ms,
            "rounds": float(found.rounds),
            "late_rounds": float(found.late),
            "missed_rounds": float(found.missed),
            "least_futures": float(found.least_futures),
        },
    )
