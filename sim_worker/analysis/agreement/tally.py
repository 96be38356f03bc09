"""What many windows say together: agreement on pass and fail, and the gaps that flip it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from foretwin.sim_worker.analysis.agreement.criteria import (
    CRITERIA,
    CriteriaEvaluator,
    Verdicts,
    Window,
    verdicts,
)
from foretwin.sim_worker.analysis.agreement.flip import DIRECTIONS, Flip, flips, gap_between

OUTCOMES = ("agree_pass", "agree_fail", "too_pessimistic", "too_optimistic")
"""Too pessimistic: the simulation fails, the drive passed; too optimistic the other way round."""


class Judged(NamedTuple):
    """One window with its verdicts, the greatest gap along and across, and what flips it."""

    window: Window
    verdicts: Verdicts
    gap_along_m: float
    gap_across_m: float
    flips: tuple[Flip, ...]

    @property
    def outcome(self) -> str:
        """One of `OUTCOMES`."""
        return outcome(self.verdicts.simulated_passes, self.verdicts.driven_passes)


def judged(window: Window, evaluator: CriteriaEvaluator) -> Judged:
    """Judge one window."""
    both = verdicts(window, evaluator)
    gap = gap_between(window.simulated, window.driven)
    found = flips(
        evaluator,
        window.simulated,
        window.simulated_users,
        gap,
        both.observable,
        passes=both.simulated_passes,
    )
    return Judged(window, both, gap.peak_m("along"), gap.peak_m("across"), found)


def outcome(simulated_passes: bool, driven_passes: bool) -> str:
    """Return which of `OUTCOMES` two verdicts make."""
    if simulated_passes == driven_passes:
        return "agree_pass" if driven_passes else "agree_fail"
    return "too_pessimistic" if driven_passes else "too_optimistic"


def tally(windows: Sequence[Judged], *, start_stamp_ns: int) -> dict[str, Any]:
    """Return counts by outcome, overall and by criterion, and the gaps that flip verdicts.

    Times in it count from `start_stamp_ns`.
    """
    overall = Counter(one.outcome for one in windows)
    by_criterion = {}
    for place, name in enumerate(CRITERIA):
        mine = [one.verdicts for one in windows if one.verdicts.observable[place]]
        found = Counter(outcome(not v.simulated[place], not v.driven[place]) for v in mine)
        by_criterion[name] = {key: found[key] for key in OUTCOMES}
    return {
        "windows": len(windows),
        "overall": {key: overall[key] for key in OUTCOMES},
        "by_criterion": by_criterion,
        "flips": {
            name: _flip_record(windows, place, start_stamp_ns)
            for place, name in enumerate(DIRECTIONS)
        },
    }


def _flip_record(windows: Sequence[Judged], place: int, start_stamp_ns: int) -> dict[str, Any]:
    """Return how many windows flip, the smallest factor with its window, and median metres."""
    found = [
        (flip.factor, flip.gap_m, one.window, flip.fails)
        for one in windows
        if (flip := one.flips[place]).factor is not None and flip.gap_m is not None
    ]
    if not found:
        return {"flipped": 0}
    factor, gap_m, window, fails = min(found, key=lambda one: one[0])
    return {
        "flipped": len(found),
        "smallest_factor": round(factor, 3),
        "smallest_factor_gap_m": round(gap_m, 3),
        "smallest_factor_at_s": round((window.stamp_ns - start_stamp_ns) / 1e9, 2),
        "smallest_factor_fails": list(fails),
        "smallest_gap_m": round(min(one[1] for one in found), 3),
        "median_gap_m": round(float(np.median([one[1] for one in found])), 3),
        "by_a_gap_no_larger_than_measured": sum(one[0] <= 1.0 for one in found),
    }
