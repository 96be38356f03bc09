"""64 futures of 8 s with a planner at 20 Hz on open ground, against stepping the model in C."""

from __future__ import annotations

from tests.benchmarks.closed_loop import measure_at
from tests.benchmarks.measuring import Measurement


def measure() -> Measurement:
    """Return simulated seconds per CPU second of whole jobs."""
    return measure_at(20.0)
