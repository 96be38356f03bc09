"""How far two courses lie apart whatever the time: discrete Fréchet distance and time warping."""

from __future__ import annotations

import numpy as np

from contracts.arrays import Array
from sim_worker.metrics.displacement import known, nowhere
from sim_worker.metrics.rollout import Measure
from sim_worker.metrics.scene import Scene


def frechet_distance(curves: Array, reference: Array) -> Array:
    """Return (S,) discrete Fréchet distances in metres of curves (S, N, 2) from one (M, 2).

    Eiter and Mannila (1994), Computing Discrete Fréchet Distance, table 1.
    """
    return _cheapest_walks(curves, reference, (np.maximum,))[0]


def warping_distance(curves: Array, reference: Array) -> Array:
    """Return (S,) least sums of distances in metres over all monotonous pairings of the points.

    Dynamic time warping: Sakoe and Chiba (1978), Dynamic Programming Algorithm Optimization for
    Spoken Word Recognition, equation 11, with weight 1 for every pair and no window.
    """
    return _cheapest_walks(curves, reference, (np.add,))[0]


def _cheapest_walks(
    curves: Array, reference: Array, accumulates: tuple[np.ufunc, ...]
) -> list[Array]:
    """Return (S,), for each way to accumulate distances, the cheapest walk that never goes back.

    An entry of the matrix of all pairs of points needs the row before and the column before: all
    entries of one diagonal are computed at once, distances too, which so stay in the cache.
    Entry i of a diagonal stands at place i + 1 of its buffer, with nothing below.
    """
    x, y = (np.ascontiguousarray(curves[..., k].T) for k in range(2))
    back_x, back_y = (np.ascontiguousarray(reference[::-1, k, None]) for k in range(2))
    rows, count = x.shape
    columns = len(reference)
    buffers = [
        [np.full((rows + 1, count), np.inf), np.full((rows + 1, count), np.inf)]
        for _ in accumulates
    ]
    values, across = np.empty((rows, count)), np.empty((rows, count))
    for diagonal in range(rows + columns - 1):
        low, high = max(0, diagonal - columns + 1), min(diagonal, rows - 1) + 1
        other = slice(columns - 1 - diagonal + low, columns - 1 - diagonal + high)
        here, aside = values[: high - low], across[: high - low]
        np.subtract(x[low:high], back_x[other], out=here)
        np.subtract(y[low:high], back_y[other], out=aside)
        here *= here
        aside *= aside
        here += aside
        np.sqrt(here, out=here)
        for pair, accumulate in zip(buffers, accumulates, strict=True):
            before, earlier = pair
            if diagonal:
                np.minimum(before[low + 1 : high + 1], before[low:high], out=aside)
                np.minimum(aside, earlier[low:high], out=aside)
                accumulate(aside, here, out=earlier[low + 1 : high + 1])
            else:
                earlier[1] = here[0]
            pair[0], pair[1] = earlier, before
    return [np.array(pair[0][rows]) for pair in buffers]


def frechet(scene: Scene) -> Measure:
    """Discrete Fréchet distance (S,) from the reference's course."""
    found = scene.keep(_from_reference)
    return scene.measure(found[0]) if found else nowhere(scene)


def dtw(scene: Scene) -> Measure:
    """Time warping distance (S,) from the reference's course, a sum over pairs of points."""
    found = scene.keep(_from_reference)
    return scene.measure(found[1]) if found else nowhere(scene)


def _from_reference(scene: Scene) -> list[Array]:
    predicted, reference = known(scene)
    if not len(reference):
        return []
    return _cheapest_walks(predicted[..., :2], reference[:, :2], (np.maximum, np.add))
