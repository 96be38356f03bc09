"""Counts held against their exposure over many drives: rates, shares, exact intervals, a trend.

Rates take events as Poisson's: the interval is Garwood's (1936, Biometrika 28), and two halves are
compared by the binomial test of one's events given both's (Przyborowski and Wilenski 1940,
Biometrika 31). Shares have the interval of Clopper and Pearson (1934, Biometrika 26) and Fisher's
exact test. Events that come in bursts are neither: intervals are too narrow for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from scipy import stats

LEVEL, CONFIDENCE = 0.05, 0.95
LEAST_DRIVES = 4
"""Of fewer, a half is a single drive."""
Trend = Literal["more", "fewer"]


class CountedEvents(NamedTuple):
    """Events of one drive, and what they are held against: kilometres, hours, passes or trials."""

    events: int
    exposure: float


class ExactInterval(NamedTuple):
    """A rate or share with its 95 % interval."""

    value: float
    low: float
    high: float


def rate_of(events: int, exposure: float) -> ExactInterval | None:
    """Return events per unit of exposure; None without exposure."""
    if exposure <= 0.0:
        return None
    tail = (1.0 - CONFIDENCE) / 2.0
    low = float(stats.chi2.ppf(tail, 2 * events)) / 2.0 if events else 0.0
    high = float(stats.chi2.ppf(1.0 - tail, 2 * events + 2)) / 2.0
    return ExactInterval(events / exposure, low / exposure, high / exposure)


def share_of(events: int, trials: int) -> ExactInterval | None:
    """Return the share of trials that are events, 0 to 1; None without trials."""
    if trials <= 0:
        return None
    found = stats.binomtest(events, trials).proportion_ci(CONFIDENCE, method="exact")
    return ExactInterval(events / trials, float(found.low), float(found.high))


def change_p(drives: Sequence[CountedEvents], *, share: bool) -> float | None:
    """Return the two-sided p that the later half of drives is as the earlier; None where a half
    has no exposure, nothing happened, or there are too few drives.

    `drives` are in the order of time, those without exposure left out before they are halved.
    """
    exposed = [one for one in drives if one.exposure > 0.0]
    if len(exposed) < LEAST_DRIVES:
        return None
    earlier, later = _halves(exposed)
    if earlier.events + later.events == 0:
        return None
    if share:
        table = [[one.events, round(one.exposure) - one.events] for one in (earlier, later)]
        return float(stats.fisher_exact(table).pvalue)
    part = later.exposure / (earlier.exposure + later.exposure)
    return float(stats.binomtest(later.events, earlier.events + later.events, part).pvalue)


def trend_of(drives: Sequence[CountedEvents]) -> Trend:
    """Return how the later half of drives differs from the earlier, significantly or not."""
    earlier, later = _halves([one for one in drives if one.exposure > 0.0])
    grew = later.events * earlier.exposure > earlier.events * later.exposure
    return "more" if grew else "fewer"


def adjusted_p(p_values: Sequence[float | None]) -> list[float | None]:
    """Return p values of many tests such that any at all of them is below a level by chance with
    that probability at most (Holm 1979, Scandinavian Journal of Statistics 6); None stays."""
    order = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    found: list[float | None] = [None] * len(p_values)
    most = 0.0
    for rank, (p, place) in enumerate(order):
        most = max(most, min(1.0, p * (len(order) - rank)))
        found[place] = most
    return found


def _halves(drives: Sequence[CountedEvents]) -> tuple[CountedEvents, CountedEvents]:
    middle = len(drives) // 2
    earlier, later = (
        CountedEvents(sum(one.events for one in half), sum(one.exposure for one in half))
        for half in (drives[:middle], drives[middle:])
    )
    return earlier, later
