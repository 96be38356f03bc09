"""Post-encroachment times where a future ends, and where a track does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Rollout
from tests.sim_worker.metrics.motions import LENGTH_M, WIDTH_M, Mover, rollout


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


def walked_before(
    *, seen_until_s: float, turned_rad: float = 0.0, seen_from_s: float = 0.0
) -> float:
    """Somebody walks across 3 m before a car of 10 m/s comes, and is seen from and until then."""
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    ego = Mover(-30 * cos, -30 * sin, turned_rad, 10)
    walker = Mover(2 * sin, -2 * cos, turned_rad + math.pi / 2, 1.4, 0.5, 0.5)
    driven = rollout(ego, walker)
    unseen = (driven.time_s > seen_until_s) | (driven.time_s < seen_from_s)
    driven.users[0, unseen], driven.user_speed_mps[0, unseen] = np.nan, np.nan
    return pet(driven)


@pytest.mark.parametrize("turned_rad", [0.0, 0.3, math.pi / 2, math.pi])
def test_of_who_is_lost_on_the_path_nobody_knows_when_it_left(turned_rad: float) -> None:
    left_s = (2.0 + WIDTH_M / 2 + 0.25) / 1.4
    known = 3.0 - (LENGTH_M / 2 + 0.25) / 10 - left_s
    assert walked_before(seen_until_s=9.0, turned_rad=turned_rad) == pytest.approx(known)
    assert walked_before(seen_until_s=2.3, turned_rad=turned_rad) == pytest.approx(known)

    for seen_until_s in (2.0, 1.6):
        assert math.isnan(walked_before(seen_until_s=seen_until_s, turned_rad=turned_rad))
    # When it came does not matter: it left first.
    came = walked_before(seen_until_s=9.0, seen_from_s=1.0, turned_rad=turned_rad)
    assert came == pytest.approx(known)


def test_who_is_lost_on_the_path_after_the_car_came_after_it() -> None:
    driven = rollout(Mover(-10, 0, 0, 10), Mover(0, -8, math.pi / 2, 1.4, 0.5, 0.5))
    whole = pet(driven)
    driven.users[0, 60:], driven.user_speed_mps[0, 60:] = np.nan, np.nan

    assert pet(driven) == pytest.approx(whole)
    assert 0.0 < whole < 5.0


def test_of_those_that_are_seen_the_narrowest_counts() -> None:
    lost = Mover(0, -2, math.pi / 2, 1.4, 0.5, 0.5)
    later = Mover(0, -12, math.pi / 2, 2.0, 0.5, 0.5)
    driven = rollout(Mover(-30, 0, 0, 10), lost, later)
    driven.users[0, 17:, 0], driven.user_speed_mps[0, 17:, 0] = np.nan, np.nan

    assert pet(driven) == pytest.approx(pet(rollout(Mover(-30, 0, 0, 10), later)))
