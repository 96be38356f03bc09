"""64 futures of 8 s between 200 buildings, other road users in some, against stepping in C."""

from __future__ import annotations

from tests.benchmarks.futures_closed_loop_20hz import measure_scene
from tests.benchmarks.measuring import Measurement


def measure() -> Measurement:
    """Return simulated seconds per CPU second of whole jobs."""
    return measure_scene(buildings=200, road_users=True)
