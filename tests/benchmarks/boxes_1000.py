"""Cars between 1000 static boxes, against the same cars on open ground."""

from __future__ import annotations

from tests.benchmarks.boxes import measure_among
from tests.benchmarks.measuring import Measurement


def measure() -> Measurement:
    """Return CPU seconds of stepping."""
    return measure_among(1000)
