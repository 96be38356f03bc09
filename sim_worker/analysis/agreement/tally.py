"""What many windows say together: agreement on pass and fail, and the gaps that flip it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple, get_args

import numpy as np

from foretwin.sim_worker.analysis.agreement.criteria import (
    CRITERIA,
    CriteriaEvaluator,
    Verdicts,
    verdicts,
)
from foretwin.sim_worker.analysis.agreement.flip import DIRECTIONS, Flip, flips, gap_between
from foretwin.sim_worker.analysis.agreement.judgement import Judgement, VerdictWord, word
from foretwin.sim_worker.analysis.agreement.window import Window

OUTCOMES = ("agree_pass", "agree_fail", "too_pessimistic", "too_optimistic", "not_observable")
"""Too pessimistic: the simulation fails, the drive passed; too optimistic the other way round. Not
observable: of one side it cannot be said."""
NOT_ASKED = "not_asked"
"""Of a criterion that reality has no means to answer, beside `OUTCOMES`."""


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
        return outcome(self.verdicts.simulated_word, self.verdicts.driven_word)


def judged(window: Window, evaluator: CriteriaEvaluator) -> Judged:
    """Judge one window."""
    both = verdicts(window, evaluator)
    gap = gap_between(window.simulated, window.driven)
    found = flips(
        evaluator,
        window.simulated,
        window.simulated_users,
        gap,
        both.asked,
        fails=both.simulated_word == "failed",
    )
    return Judged(window, both, gap.peak_m("along"), gap.peak_m("across"), found)


def outcome(simulated: VerdictWord, driven: VerdictWord) -> str:
    """Return which of `OUTCOMES` two verdicts make."""
    if "not_observable" in (simulated, driven):
        return "not_observable"
    if simulated == driven:
        return "agree_pass" if driven == "passed" else "agree_fail"
    return "too_pessimistic" if driven == "passed" else "too_optimistic"


def tally(windows: Sequence[Judged], *, start_stamp_ns: int) -> dict[str, Any]:
    """Return counts by outcome, overall and by criterion, and the gaps that flip verdicts.

    Times in it count from `start_stamp_ns`.
    """
    overall = Counter(one.outcome for one in windows)
    driven = Counter(one.verdicts.driven_word for one in windows)
    by_criterion = {}
    for place, name in enumerate(CRITERIA):
        found = Counter(_outcome_of(one.verdicts, place) for one in windows)
        by_criterion[name] = {key: found[key] for key in (*OUTCOMES, NOT_ASKED)}
    return {
        "windows": len(windows),
        "overall": {key: overall[key] for key in OUTCOMES},
        "driven": {key: driven[key] for key in get_args(VerdictWord)},
        "by_criterion": by_criterion,
        "flips": {
            name: _flip_record(windows, place, start_stamp_ns)
            for place, name in enumerate(DIRECTIONS)
        },
    }


def _outcome_of(both: Verdicts, place: int) -> str:
    if not both.asked[place]:
        return NOT_ASKED
    return outcome(_at(both.simulated, place), _at(both.driven, place))


def _at(side: Judgement, place: int) -> VerdictWord:
    return word(bool(side.passes[place]), bool(side.fails[place]))


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
        "smallest_factor_measured_m": round(gap_m / factor, 3),
        "smallest_factor_at_s": round((window.stamp_ns - start_stamp_ns) / 1e9, 2),
        "smallest_factor_fails": list(fails),
        "smallest_gap_m": round(min(one[1] for one in found), 3),
        "median_gap_m": round(float(np.median([one[1] for one in found])), 3),
        "by_a_gap_no_larger_than_measured": sum(one[0] <= 1.0 for one in found),
    }
