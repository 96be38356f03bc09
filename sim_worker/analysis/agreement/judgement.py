"""What can be said of motions by several criteria: kept, broken, or neither."""

from __future__ import annotations

from typing import Literal, NamedTuple

from foretwin.contracts.arrays import Flags

VerdictWord = Literal["passed", "failed", "not_observable"]


class Judgement(NamedTuple):
    """Which criteria are kept and which broken, both of one shape; where neither, nothing can be
    said."""

    passes: Flags
    fails: Flags


def word(passes: bool, fails: bool) -> VerdictWord:
    """Return one answer of a judgement."""
    if fails:
        return "failed"
    return "passed" if passes else "not_observable"
