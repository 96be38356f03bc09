"""One World of all of Liechtenstein against SUMO's netconvert."""

from __future__ import annotations

from tests.benchmarks.measuring import Measurement
from tests.benchmarks.netconvert import measure_on


def measure() -> Measurement:
    """Return wall seconds of whole processes, and of the work inside ours."""
    return measure_on("osm-liechtenstein/liechtenstein-latest.osm.pbf")
