"""How alike other drivers are to recorded ones, to be said beside every share of collisions.

The figures are measured by `python -m tests.sim_worker.realism --write`, on recordings that the
program does not hold.
"""

from __future__ import annotations

import functools
from pathlib import Path

import msgspec

_FILE = Path(__file__).with_name("likeness.json")


class DriverLikeness(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Of one quantity at one crossing: how far the simulated distribution lies from the recorded
    one, after Wasserstein, in the quantity's `unit` and in the recorded one's standard deviations.

    `fitted` says that the manners of drivers were fitted there; `recorded` is the number of values.
    """

    crossing: str
    fitted: bool
    quantity: str
    unit: str
    distance: float
    deviations: float
    recorded: int


@functools.cache
def likenesses() -> tuple[DriverLikeness, ...]:
    """Return what was measured of the drivers of this version."""
    return msgspec.json.decode(_FILE.read_bytes(), type=tuple[DriverLikeness, ...])


def likeness_words() -> str:
    """Return in one line how far drivers are from those of the crossing that none was fitted to."""
    rows = [row for row in likenesses() if not row.fitted]
    what = ", ".join(
        f"{row.quantity} {row.distance:.2f} {row.unit} ({row.deviations:.2f} sd)" for row in rows
    )
    return (
        "law-abiding drivers differ from recorded ones, at a crossing that they were not fitted to "
        f"({rows[0].crossing}), in {what}; sd: of what was recorded"
    )
