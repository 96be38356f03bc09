"""What a change of paired values comes to: an interval, and how likely chance alone makes it.

Pairs of one place are alike, those of one approach half a second apart most of all, so places are
drawn, whole, and of too few places nothing is said. All tests are SciPy's: a sign-flip permutation
test and the percentile bootstrap (Efron and Tibshirani 1993, An Introduction to the Bootstrap), of
clusters as Davison and Hinkley 1997, section 3.8, and Benjamini and Hochberg 1995 for many tests at
once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from foretwin.contracts.arrays import Array

LEAST_PLACES = 6
"""Of fewer, all signs are alike by chance in 1 of 16 and more: nothing could be significant."""
LEVEL, CONFIDENCE = 0.05, 0.95
RESAMPLES = 2000
_SEED = 0


class PairedChange(NamedTuple):
    """Mean of B minus A with its 95 % interval; `p_value` that the sign is chance's; None where
    there are fewer places than `LEAST_PLACES`."""

    mean: float
    low: float | None
    high: float | None
    p_value: float | None
    units: int
    """Places in which there are pairs."""


def paired_change(differences: Array, places: Sequence[object]) -> PairedChange:
    """Return the mean of paired differences (N,), N > 0, whose places are given beside them."""
    names, of = np.unique(np.asarray([str(one) for one in places]), return_inverse=True)
    sums, counts = np.bincount(of, weights=differences), np.bincount(of).astype(float)
    mean, units = float(np.mean(differences)), len(names)
    if units < LEAST_PLACES:
        return PairedChange(mean, None, None, None, units)
    if not np.any(differences):
        return PairedChange(0.0, 0.0, 0.0, 1.0, units)
    drawn = stats.bootstrap(
        (sums, counts), _ratio, paired=True, vectorized=True, n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE, method="percentile", rng=np.random.default_rng(_SEED),
    )  # fmt: skip
    flipped = stats.permutation_test(
        (sums,), _total, permutation_type="samples", vectorized=True, n_resamples=RESAMPLES,
        rng=np.random.default_rng(_SEED),
    )  # fmt: skip
    low, high = (float(side) for side in drawn.confidence_interval)
    return PairedChange(mean, low, high, float(flipped.pvalue), units)


def adjusted(p_values: Sequence[float | None]) -> list[float | None]:
    """Return p values of many tests such that of those below a level that share at most is by
    chance (Benjamini and Hochberg); None stays."""
    told = [p for p in p_values if p is not None]
    if not told:
        return list(p_values)
    rest = iter(stats.false_discovery_control(told).tolist())
    return [None if p is None else next(rest) for p in p_values]


def _ratio(sums: Array, counts: Array, axis: int = -1) -> Array:
    total: Array = np.sum(sums, axis=axis) / np.sum(counts, axis=axis)
    return total


def _total(sums: Array, axis: int = -1) -> Array:
    total: Array = np.sum(sums, axis=axis)
    return total
