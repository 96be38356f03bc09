"""How one signal follows others after a shift in time: sizes, the shift, and how sure both are.

Sensors stamp by clocks of their own, and late. The shift is sought on a grid and then fitted
together with all else, by Gauss and Newton; deviations come from leaving out one stretch of
driving after the other (block jackknife: Künsch 1989), since neighbouring samples err alike. What a
prior holds does not move with that, and is as uncertain as the prior.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import special

from foretwin.contracts.arrays import Array, Flags, Indices

TOGETHER_S = 0.3
"""Samples of a car's motion nearer to each other than this err alike."""
BLOCK_S = 6.0
"""Of driving that is left out at once: longer than a bend, in which a model errs alike."""
LONGEST_SHIFT_S = 1.0
"""Sought for either way. Chosen: what telephones and adapters send is late by up to 0.6 s."""
_LEAST_BLOCKS = 5
LEAST_S = _LEAST_BLOCKS * BLOCK_S
"""Nothing is fitted to less."""
_ROUNDS = 3


class ShiftedFit(NamedTuple):
    """y = columns shifted by `shift_s` @ sizes; a positive shift: y comes later than the columns.

    `covariance` (C + 1, C + 1) is of sizes and shift, `quantile` (C + 1,) is half of their 95 %
    intervals in standard deviations. `without` (B, C + 1) has both as each stretch of driving
    leaves them that is left out; `block` (N,) says which that is, -1 where nothing was compared.
    `at_the_end` says that the shift is the longest that was tried: it may be anything beyond.
    """

    sizes: Array
    shift_s: float
    covariance: Array
    quantile: Array
    without: Array
    block: Indices
    at_the_end: bool

    @property
    def shift_std_s(self) -> float:
        """Standard deviation of the shift."""
        return float(np.sqrt(self.covariance[-1, -1]))

    @property
    def half_widths(self) -> Array:
        """Half of the 95 % intervals of sizes and shift (C + 1,)."""
        return np.asarray(self.quantile * np.sqrt(np.diagonal(self.covariance)))


def shifted(column: Array, shift_s: float, *, period_s: float) -> Array:
    """Return a signal (N,) on a grid as it comes `shift_s` later, NaN where unknown."""
    at = np.arange(len(column)) - shift_s / period_s
    before = np.floor(at).astype(np.intp)
    part = at - before
    inside = (before >= 0) & (before < len(column) - 1)
    low = np.clip(before, 0, max(len(column) - 2, 0))
    value = column[low] * (1.0 - part) + column[np.minimum(low + 1, len(column) - 1)] * part
    return np.where(inside, value, np.nan)


def shifted_fit(
    y: Array,
    columns: Array,
    *,
    period_s: float,
    around: Array,
    prior_std: Array,
    shift_prior_s: float = float("inf"),
    longest_s: float = LONGEST_SHIFT_S,
) -> ShiftedFit | None:
    """Fit y (N,) by columns (N, C), shifted together by up to `longest_s`; grid of `period_s`.

    Sizes are `around` (C,) give or take `prior_std` (C,), infinite where nothing is known, and the
    shift is 0 give or take `shift_prior_s`. None for less than `LEAST_S` that can be compared.
    """
    longest = round(longest_s / period_s)
    known = np.isfinite(y) & _known_around(columns, longest)
    block = _blocks(known, period_s)
    if known.sum() * period_s < LEAST_S:
        return None
    count = int(block.max()) + 1
    most = 0 if np.isfinite(shift_prior_s) else longest
    late, variance = _best_on_grid(y, columns, known, most)
    shift_s = late * period_s
    prior = np.diag(np.append(prior_std, shift_prior_s) ** -2.0)
    theta, without, normal = np.zeros(0), np.zeros(0), np.zeros(0)
    for _ in range(_ROUNDS):
        rows = np.stack(
            [shifted(column, shift_s, period_s=period_s) for column in columns.T], axis=1
        )
        slope = -np.gradient(rows @ (theta[:-1] if len(theta) else around)) / period_s
        design = np.column_stack([rows, slope])
        used = known & np.isfinite(design).all(axis=1)
        weight = period_s / TOGETHER_S / variance
        each = np.zeros((count, design.shape[1], design.shape[1] + 1))
        joined = np.column_stack([design, y])
        for number in range(count):
            mine = used & (block == number)
            each[number] = weight * design[mine].T @ joined[mine]
        wanted = prior @ np.append(around, -shift_s)
        normal = each.sum(axis=0)
        theta = _solve(normal, prior, wanted)
        without = np.stack([_solve(normal - one, prior, wanted) for one in each])
        variance = max(float(np.mean((y[used] - design[used] @ theta) ** 2)), 1e-12)
        moved_s = float(np.clip(theta[-1], -0.1, 0.1))
        without[:, -1] += shift_s
        shift_s = float(np.clip(shift_s + moved_s, -longest_s, longest_s))
    off = without - without.mean(axis=0)
    told = (count - 1) / count * off.T @ off
    held, *_ = np.linalg.lstsq(normal[:, :-1] + prior, np.sqrt(prior), rcond=None)
    covariance = told + held @ held.T
    freedom = _freedom(np.diagonal(told), np.diagonal(covariance), count)
    quantile = np.asarray(special.stdtrit(freedom, 0.975))
    at_the_end = abs(shift_s) > longest_s - period_s
    return ShiftedFit(theta[:-1], shift_s, covariance, quantile, without, block, at_the_end)


def _freedom(told: Array, whole: Array, count: int) -> Array:
    """Return degrees of freedom of variances (C,), of which `told` (C,) come from few stretches.

    Satterthwaite's (1946): what a prior adds is known, as of any number of them.
    """
    share = told / np.maximum(whole, 1e-300)
    return np.asarray((count - 1) / np.maximum(share, 1e-6) ** 2)


def _solve(normal: Array, prior: Array, wanted: Array) -> Array:
    found, *_ = np.linalg.lstsq(normal[:, :-1] + prior, normal[:, -1] + wanted, rcond=None)
    return np.asarray(found)


def _known_around(columns: Array, most: int) -> Flags:
    """Return where all columns (N, C) are known, the longest shift before and after too."""
    unknown = np.concatenate([[0], np.cumsum(~np.isfinite(columns).all(axis=1))])
    count = len(columns)
    at = np.arange(count)
    first, last = at - most - 1, at + most + 1
    inside = (first >= 0) & (last < count)
    first, last = np.clip(first, 0, count - 1), np.clip(last, 0, count - 1)
    return np.asarray(inside & (unknown[last + 1] == unknown[first]))


def _blocks(known: Flags, period_s: float) -> Indices:
    """Number the stretches of driving (N,) by what of them can be compared."""
    return np.where(known, (np.cumsum(known) - 1) // round(BLOCK_S / period_s), -1)


def _best_on_grid(y: Array, columns: Array, known: Flags, most: int) -> tuple[int, float]:
    """Return the shift in ticks that leaves least of y, and the mean square left."""
    at = np.flatnonzero(known)
    best = (np.inf, 0)
    for late in range(-most, most + 1):
        rows = columns[at - late]
        sizes, *_ = np.linalg.lstsq(rows, y[at], rcond=None)
        best = min(best, (float(np.mean((y[at] - rows @ sizes) ** 2)), late))
    return best[1], max(best[0], 1e-12)
