"""Post-encroachment times where a future ends, and where a track does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Rollout
from tests.sim_worker.metrics.motions import LENGTH_M, Mover, rollout


def pet(driven: Rollout) -> float:
    return float(evaluate(driven, ("pet",))["pet"].values[0])


@pytest.mark.parametrize("hit_s", [5.03, 7.83, 7.93, 7.97])
@pytest.mark.parametrize("ends", [True, False])
def test_who_meets_where_ways_cross_has_none_be_it_in_the_last_step(
    hit_s: float, ends: bool
) -> None:
    """The ego's front reaches the side of a car that crosses, before their middles do."""
    ego = Mover(-(10 * hit_s + LENGTH_M / 2 + 1.0), 0, 0, 10)
    driven = rollout(ego, Mover(0, -5 * hit_s, math.pi / 2, 5))
    last = min(math.ceil(hit_s / 0.1), len(driven.time_s) - 1)

    assert pet(driven._replace(last=np.array([last]) if ends else None)) == 0.0
