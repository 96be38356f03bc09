"""What all processes of a live drive take together, against what its workers take."""

from __future__ import annotations

from tests.benchmarks.live_drive import live_drive
from tests.benchmarks.measuring import Measurement


def measure() -> Measurement:
    """Return shares of a core, since each process could take work."""
    shares = live_drive().shares
    workers = sum(share for name, share in shares.items() if name.startswith("w"))
    return Measurement(sum(shares.values()), "cores", workers, shares)
