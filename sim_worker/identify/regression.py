"""Least squares with weak priors whose intervals stay honest when residuals are coloured.

Sensor noise is white, but what a planar model leaves unexplained is not: neighbouring residuals
are alike for seconds. The covariance is therefore the sandwich of Liang and Zeger (1986) with
stretches of time as clusters, and quantiles are Student's with as many degrees of freedom as there
are stretches (Cameron and Miller, 2015, "A practitioner's guide to cluster-robust inference").
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from contracts.arrays import Array

Stretches = np.ndarray[Any, np.dtype[np.int64]]


class Fit(NamedTuple):
    """Estimates of K parameters: `values` (K,), `covariance` (K, K), and the residuals (N,)."""

    values: Array
    covariance: Array
    quantile: float
    """Half the width of a 95 % interval, in standard deviations."""
    residuals: Array

    def half_width(self, index: int) -> float:
        """Return half the 95 % interval of one parameter."""
        return float(self.quantile * np.sqrt(self.covariance[index, index]))


def stretches(time_s: Array, *, length_s: float = 3.0) -> Stretches:
    """Number each instant by the stretch of `length_s` that it lies in."""
    return np.asarray(np.floor(time_s / length_s), dtype=np.int64)


def fit_linear(
    columns: Array,
    target: Array,
    stretch: Stretches,
    *,
    prior: Array | None = None,
    prior_std: Array | None = None,
    least_std: float = 0.0,
) -> Fit:
    """Solve `columns` (N, K) · values = `target` (N,) with Gaussian priors (K,), inf for none.

    `least_std` is what one instant can be trusted to at best, however well the columns explain
    it: it weighs the priors against the data and leaves the interval to the residuals.

    Raises ValueError with fewer stretches than parameters need to leave a residual, or for a
    column of zeros without a prior.
    """
    count = columns.shape[1]
    names, group = np.unique(stretch, return_inverse=True)
    groups = len(names)
    if groups < count + 2:
        raise ValueError(
            f"{groups} stretches of driving for {count} parameters; {count + 2} needed at least"
        )
    if prior_std is None or not np.isfinite(prior_std).all():
        free = np.full(count, np.inf) if prior_std is None else prior_std
        if np.any(np.isinf(free) & ~np.any(columns, axis=0)):
            raise ValueError("a parameter had no part in the driving")
    precision = np.zeros(count) if prior_std is None else 1.0 / np.square(prior_std)
    centre = np.zeros(count) if prior is None else np.asarray(prior, dtype=np.float64)
    gram = columns.T @ columns
    moment = columns.T @ target
    # Numbers of parameters differ by orders of magnitude; scale them before solving.
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, residuals = centre, target - columns @ centre
    variance = float(np.mean(np.square(residuals))) + 1e-300
    inverse = meat = np.zeros((count, count))
    for _ in range(3):
        normal = gram / variance + np.diag(precision)
        inverse = scale[:, None] * np.linalg.pinv(scale[:, None] * normal * scale) * scale
        values = inverse @ (moment / variance + precision * centre)
        residuals = target - columns @ values
        white = float(np.mean(np.square(residuals))) + 1e-300
        sums = np.zeros((groups, count))
        np.add.at(sums, group, columns * residuals[:, None])
        meat = sums.T @ sums * (groups / (groups - 1.0))
        # Alike residuals say less than as many white ones: priors must weigh accordingly.
        likeness = float(np.mean(np.diag(meat) * scale**2)) / white
        variance = max(white * max(likeness, 1.0), least_std**2)
    spread = meat / variance**2 + np.diag(precision)
    return Fit(
        values=values,
        covariance=np.asarray(inverse @ spread @ inverse),
        quantile=float(stats.t.ppf(0.975, groups - count)),
        residuals=np.asarray(residuals),
    )
