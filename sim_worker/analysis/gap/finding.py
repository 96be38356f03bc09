"""What a comparison of signals accuses somebody of."""

from __future__ import annotations

from typing import NamedTuple

from foretwin.contracts.gap import Culprit, Evidence


class Finding(NamedTuple):
    """One departure: who, how, and the comparisons that say so."""

    culprit: Culprit
    cause: str
    text: str
    evidence: tuple[Evidence, ...]
    since_ns: int = 0
    """When it began."""
