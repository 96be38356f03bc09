"""Conflicts of a drive, each once, however many rows tell of it.

Following, the lead's braking and its cutting in are rows of their own that overlap in time, and the
one least time to collision of all of them stands in each.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from operator import attrgetter

from foretwin.sim_worker.analysis.occurred.rows import OccurredScenario


def conflicts_of(
    scenarios: Iterable[OccurredScenario], *, by: str = ""
) -> tuple[OccurredScenario, ...]:
    """Return one row of each conflict in one drive, by when it ended; with `by` of those that pass
    this one of `THRESHOLDS`.

    Each row's threshold was passed at some moment within it. Conflicts with one other road user are
    the fewest moments that explain all its rows, which are the most rows of which no two overlap:
    found by taking what ends first and passing by what overlaps it.
    """
    with_other: dict[str, list[OccurredScenario]] = defaultdict(list)
    for one in scenarios:
        if by in one.beyond if by else one.is_conflict:
            with_other[one.other_id].append(one)
    found: list[OccurredScenario] = []
    for rows in with_other.values():
        until_ns = None
        for one in sorted(rows, key=attrgetter("end_ns", "begin_ns")):
            if until_ns is None or one.begin_ns >= until_ns:
                found.append(one)
                until_ns = one.end_ns
    return tuple(sorted(found, key=attrgetter("end_ns", "other_id")))
