"""One zero-phase filter for all signals of a regression, so that linear relations stay true."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from foretwin.contracts.arrays import Array


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


def delayed(values: Array, *, period_s: float, delay_s: float) -> Array:
    """Return what (N,) was `delay_s` ago, between instants linearly; NaN before the beginning."""
    at = np.arange(len(values)) - delay_s / period_s
    return np.asarray(np.interp(at, np.arange(len(values)), values, left=np.nan, right=np.nan))
