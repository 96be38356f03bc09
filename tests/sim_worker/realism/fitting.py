"""Manners of drivers that come as near to a crossing's recordings as they can."""

from __future__ import annotations

import sys

import numpy as np

from foretwin.sim_worker.road_users.manners import SPREADS, Manners, Spreads
from tests.sim_worker.realism.figures import Crossing, Distance, distances, samples

_FITTED = ("time_gap_s", "accel_mps2", "decel_mps2", "lateral_mps2", "limit_share", "reaction_s")
_JUDGED = ("speed", "acceleration", "deceleration", "lateral", "gap", "headway")
_LEAST, _MOST = 0.05, 0.6
"""Spreads of a number among drivers."""


def score(found: dict[str, Distance]) -> float:
    """Return the mean distance in standard deviations of what there is enough of."""
    return float(np.mean([found[name].normalised for name in _JUDGED]))


def fitted(crossing: Crossing, *, tries: int, seed: int = 0) -> Spreads:
    """Return the manners that lie nearest, by steps drawn about the best until then."""
    draw = np.random.default_rng(seed)
    rows = [Manners._fields.index(name) for name in _FITTED]
    best = np.array(SPREADS)
    best_score, step = score(distances(crossing.recorded, samples(crossing, draws=1))), 0.25
    for number in range(tries):
        trial = best.copy()
        chosen = [row for row in rows if draw.random() < 0.5] or rows
        trial[chosen, 0] *= np.exp(step * draw.standard_normal(len(chosen)))
        spread = trial[chosen, 1] * np.exp(2.0 * step * draw.standard_normal(len(chosen)))
        trial[chosen, 1] = np.clip(spread, _LEAST, _MOST)
        spreads = tuple(map(tuple, trial.tolist()))
        found = score(distances(crossing.recorded, samples(crossing, draws=1, spreads=spreads)))
        if found < best_score:
            best, best_score = trial, found
            print(f"{number:4} {best_score:.4f} {np.round(best, 3).tolist()}", file=sys.stderr)
        else:
            step = max(0.98 * step, 0.05)
    return tuple((float(median), float(spread)) for median, spread in best)
