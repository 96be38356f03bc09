"""Least squares with weak priors whose intervals stay honest when residuals are coloured.

Sensor noise is white, but what a planar model leaves unexplained is not: it lasts for a whole bend
and differs from bend to bend. Uncertainty is therefore measured by leaving out one stretch of
driving after the other (the delete-a-block jackknife of Künsch, 1989; for clusters, CV3 of
MacKinnon, Nielsen and Webb, 2023, "Fast and reliable jackknife and bootstrap methods for
cluster-robust inference"), averaged over where the stretches begin. A parameter that one single
bend tells has no other to vouch for it, and its interval says so.

Leaving out is exact for residuals that last as long as a stretch, and exaggerates by a stretch's
leverage where they do not; what is known to be brief is corrected by the root of it instead (CV2,
Bell and McCaffrey, 2002).

All signals of a regression pass one zero-phase filter, so that linear relations stay true.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage, special

from foretwin.contracts.arrays import Array

STRETCH_S = 6.0
"""Longer than a bend in town, which takes three to five seconds."""
_BEGINNINGS = 4
"""At how many instants within a stretch the first may begin."""
_GAUSSIAN_KURTOSIS = 3.0


class Fit(NamedTuple):
    """Estimates of K parameters: `values` (K,) and `covariance` (K, K)."""

    values: Array
    covariance: Array
    quantile: Array
    """Half the width of a 95 % interval, in standard deviations, for each parameter (K,)."""

    def half_width(self, index: int) -> float:
        """Return half the 95 % interval of one parameter."""
        return float(self.half_widths()[index])

    def half_widths(self) -> Array:
        """Return half the 95 % interval of each parameter (K,)."""
        return np.asarray(self.quantile * np.sqrt(np.diagonal(self.covariance)))


class _Cells(NamedTuple):
    """Sums over short cells of time (C): which cell each is, and what it says."""

    number: np.ndarray
    grams: Array
    moments: Array


def fit_linear(
    columns: Array,
    target: Array,
    time_s: Array,
    *,
    length_s: float = STRETCH_S,
    prior: Array | None = None,
    prior_std: Array | None = None,
    least_std: float = 0.0,
    brief: bool = False,
) -> Fit:
    """Solve `columns` (N, K) · values = `target` (N,) with Gaussian priors (K,), inf for none.

    `time_s` (N,) ascends; residuals count as alike within `length_s`. `least_std` is what one
    instant can be trusted to at best, however well the columns explain it: it weighs the priors
    against the data and leaves the interval to the residuals. `brief` residuals are
    alike for much less than a stretch, as those of sensors are.

    Raises ValueError for less than three stretches, or for a column of zeros without a prior.
    """
    count = columns.shape[1]
    cell = np.floor(time_s * (_BEGINNINGS / length_s)).astype(np.int64)
    if len(np.unique(cell // _BEGINNINGS)) < 3:
        raise ValueError(f"less than {3.0 * length_s:g} s of driving that could be compared")
    free = np.full(count, np.inf) if prior_std is None else prior_std
    if np.any(np.isinf(free) & ~np.any(columns, axis=0)):
        raise ValueError("a parameter had no part in the driving")
    precision = np.zeros(count) if prior_std is None else 1.0 / np.square(prior_std)
    centre = np.zeros(count) if prior is None else np.asarray(prior, dtype=np.float64)
    # Numbers of parameters differ by orders of magnitude; scale them before solving.
    scale = 1.0 / np.sqrt(np.maximum(np.sum(np.square(columns), axis=0), 1e-300))
    scaled = columns * scale
    precision, centre = precision * np.square(scale), centre / scale
    starts = np.flatnonzero(np.diff(cell, prepend=cell[0] - 1))
    ends = np.append(starts[1:], len(cell))
    grams = np.stack([scaled[a:b].T @ scaled[a:b] for a, b in zip(starts, ends, strict=True)])
    gram, moment = grams.sum(axis=0), scaled.T @ target
    values, residuals = centre, target - scaled @ centre
    variance = float(np.mean(np.square(residuals))) + 1e-300
    cells = _Cells(cell[starts], grams, np.zeros((len(starts), count)))
    for _ in range(3):
        # Parameters that nothing tells apart, and no prior, stay where they are.
        normal = gram / variance + np.diag(precision + 1e-12 / variance)
        values = np.linalg.solve(normal, moment / variance + precision * centre)
        residuals = target - scaled @ values
        cells = cells._replace(moments=np.add.reduceat(scaled * residuals[:, None], starts, axis=0))
        square = float(np.mean(np.square(residuals))) + 1e-300
        sums = _by_stretch(cells.moments, cells.number // _BEGINNINGS)
        # Alike residuals say less than as many white ones: priors must weigh accordingly.
        likeness = float(np.mean(np.sum(np.square(sums), axis=0))) / square
        variance = max(square * max(likeness, 1.0), least_std**2)
    held = precision * variance + 1e-12
    spread, freedom = _left_out(cells, gram + np.diag(held), brief=brief)
    inverse = np.linalg.inv(gram + np.diag(held))
    # What the prior holds is as uncertain as the prior.
    spread += inverse @ np.diag(precision * variance**2) @ inverse
    return Fit(
        values=values * scale,
        covariance=np.asarray(spread * scale[:, None] * scale),
        quantile=np.asarray(special.stdtrit(freedom, 0.975)),
    )


def _by_stretch(values: Array, stretch: np.ndarray) -> Array:
    starts = np.flatnonzero(np.diff(stretch, prepend=stretch[0] - 1))
    return np.asarray(np.add.reduceat(values, starts, axis=0))


def _left_out(cells: _Cells, normal: Array, *, brief: bool) -> tuple[Array, Array]:
    """Return the jackknife's covariance (K, K) and its degrees of freedom (K,).

    The degrees are Satterthwaite's of a sum of as many squares as there are stretches, from the
    squares themselves: few bends that decide alone count as few.
    """
    covariances, freedoms = [], []
    for beginning in range(_BEGINNINGS):
        stretch = (cells.number + beginning) // _BEGINNINGS
        grams, moments = _by_stretch(cells.grams, stretch), _by_stretch(cells.moments, stretch)
        groups, share = len(moments), 1.0
        if brief:
            moved = _by_root(normal, grams, moments)
        else:
            moved = np.asarray(np.linalg.solve(normal - grams, moments[..., None])[..., 0])
            share = (groups - 1.0) / groups
        squares = np.square(moved)
        covariances.append(share * moved.T @ moved)
        alone = np.sum(np.square(squares), axis=0) + 1e-300
        freedom = _GAUSSIAN_KURTOSIS * np.square(np.sum(squares, axis=0)) / alone
        freedoms.append(np.clip(freedom, 1.0, groups - 1.0))
    return np.mean(covariances, axis=0), np.mean(freedoms, axis=0)


def _by_root(normal: Array, grams: Array, moments: Array) -> Array:
    """Return A^-½ (1 - H)^-½ A^-½ m (G, K) of each stretch, H being its leverage A^-½ G A^-½."""
    root = np.linalg.inv(np.linalg.cholesky(normal))
    weights, axes = np.linalg.eigh(root @ grams @ root.T)
    weights = 1.0 / np.sqrt(np.maximum(1.0 - weights, 1e-6))
    turned = np.einsum("gji,gj->gi", axes, moments @ root.T) * weights
    return np.asarray(np.einsum("gij,gj->gi", axes, turned) @ root)


def smoothed(values: Array, *, period_s: float, width_s: float, derivative: bool = False) -> Array:
    """Blur (N,) by a Gaussian of standard deviation `width_s`, or differentiate what it gives.

    NaN wherever a value within three widths is unknown, so that nothing invented enters.
    """
    sigma = width_s / period_s
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)
    order = 1 if derivative else 0
    result = ndimage.gaussian_filter1d(filled, sigma, order=order, mode="nearest", truncate=4.0)
    if derivative:
        result /= period_s
    unknown = np.concatenate([[True], ~known, [True]])
    near = ndimage.binary_dilation(unknown, iterations=max(1, round(3.0 * sigma)))[1:-1]
    return np.asarray(np.where(near, np.nan, result))


def smoothed_and_rate(values: Array, *, period_s: float, width_s: float) -> tuple[Array, Array]:
    """Return what `smoothed` makes of (N,), and its derivative."""
    plain = smoothed(values, period_s=period_s, width_s=width_s)
    return plain, smoothed(values, period_s=period_s, width_s=width_s, derivative=True)


def delayed(values: Array, *, period_s: float, delay_s: float) -> Array:
    """Return what (N,) was `delay_s` ago, between instants linearly; NaN before the beginning."""
    at = np.arange(len(values)) - delay_s / period_s
    return np.asarray(np.interp(at, np.arange(len(values)), values, left=np.nan, right=np.nan))
