"""What all processes of a live drive take together, against what its workers take."""

from __future__ import annotations

from tests.benchmarks.live_drive import live_drive
from tests.benchmarks.measuring import Measurement


def measure() -> Measurement:
    """Return shares of a core, after the drive's beginning, tracing included; `others_cores` is
    everybody else's."""
    found = live_drive()
    workers = sum(share for name, share in found.shares.items() if name.startswith("w"))
    more = found.shares | {"others_cores": found.others_cores}
    return Measurement(sum(found.shares.values()), "cores", workers, more)
