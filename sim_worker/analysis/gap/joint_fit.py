"""Several departures fitted to one gap, so that none is put down to another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array


class JointFit(NamedTuple):
    """Sizes (C,) of causes with their standard deviations, and what they leave of the gap."""

    sizes: Array
    std: Array
    left: float
    """Sum of squares of what is left, and of what priors say against the sizes, in deviations."""


def joint_fit(gap: Array, columns: Array, *, variance: Array, prior_std: Array) -> JointFit:
    """Fit gap (K,) = columns (K, C) @ sizes with errors of `variance` (K,).

    Sizes are 0 give or take `prior_std` (C,), infinite for a cause that is free: least squares with
    a Gaussian prior (Gelman et al., Bayesian Data Analysis, 2013, 14.8).
    """
    precision = 1.0 / prior_std**2
    weighted = columns / variance[:, None]
    covariance = np.linalg.pinv(weighted.T @ columns + np.diag(precision))
    sizes = covariance @ (weighted.T @ gap)
    apart = gap - columns @ sizes
    left = float(np.sum(apart**2 / variance) + np.sum(precision * sizes**2))
    return JointFit(sizes, np.sqrt(np.maximum(np.diag(covariance), 0.0)), left)
