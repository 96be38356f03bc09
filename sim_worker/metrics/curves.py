"""How far two courses lie apart whatever the time: discrete Fréchet distance and time warping."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry import compiled
from foretwin.sim_worker.metrics.displacement import known, nowhere
from foretwin.sim_worker.metrics.rollout import Measure, RolloutView


def cheapest_walks(curves: Array, reference: Array) -> Array:
    """Return (2, S) metres: of curves (S, N, 2) from one (M, 2), the discrete Fréchet distances
    (Eiter and Mannila 1994, Computing Discrete Fréchet Distance, table 1) and the least sums.

    Both are of the walks along the pairs of points that never go back and have the least of it.
    The sums are dynamic time warping: Sakoe and Chiba (1978), Dynamic Programming Algorithm
    Optimization for Spoken Word Recognition, equation 11, weight 1 for every pair and no window.
    """
    x, y = (np.ascontiguousarray(curves[..., k], dtype=np.float64) for k in range(2))
    to_x, to_y = (np.ascontiguousarray(reference[:, k], dtype=np.float64) for k in range(2))
    found = np.empty((2, len(x)))
    compiled.cheapest_walks(x, y, to_x, to_y, found)
    return found


def frechet(view: RolloutView) -> Measure:
    """Discrete Fréchet distance (S,) from the reference's course."""
    found = view.keep(_from_reference)
    return view.measure(found[0]) if found is not None else nowhere(view)


def dtw(view: RolloutView) -> Measure:
    """Time warping distance (S,) from the reference's course, a sum over pairs of points."""
    found = view.keep(_from_reference)
    return view.measure(found[1]) if found is not None else nowhere(view)


def _from_reference(view: RolloutView) -> Array | None:
    predicted, reference = known(view)
    if not len(reference):
        return None
    return cheapest_walks(predicted[..., :2], reference[:, :2])
