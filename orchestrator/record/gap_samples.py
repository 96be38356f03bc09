"""The gaps of a run, as its table `gaps` has them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from foretwin.contracts.gap import GapSample


def gap_samples(rows: Iterable[Mapping[str, Any]]) -> list[GapSample]:
    """Return rows of a run's table of gaps as what they were made of.

    Of the run's own car, which the table does not repeat. Runs of before say nothing of what
    uncertain states leave open: it counts as nothing.
    """
    return msgspec.convert([{"vehicle_id": "", **row} for row in rows], list[GapSample])
