"""Right of way that is given, and that is not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Context, Rollout
from tests.sim_worker.metrics.junction import context
from tests.sim_worker.metrics.motions import LENGTH_M, Mover, rollout, times

HALF_M = LENGTH_M / 2


def value(driven: Rollout, name: str, given: Context) -> float:
    return float(evaluate(driven, (name,), context=given)[name].values[0])


def test_forcing_who_has_priority_to_brake_is_a_violation() -> None:
    """The ego is on the shared ground from 2.5 to 2.5 s + (length + 2 m) / 8."""
    given = context()
    ego = Mover(0.5 - HALF_M - 8.0 * 2.5, -1.5, 0.0, 8.0)

    def from_south(seconds: float, speed: float = 10.0) -> Mover:
        """Whose front is at the shared ground at that time."""
        return Mover(1.5, -2.5 - 2.0 - speed * seconds, math.pi / 2, speed)

    near = rollout(ego, from_south(2.9))
    far = rollout(ego, from_south(6.0))
    gone = rollout(ego, from_south(1.0))
    both = rollout(ego, from_south(2.9), Mover(-1.5, -0.5 + 2.0 + 30.0, -math.pi / 2, 10.0))

    assert value(near, "right_of_way_violations", given) == 1.0
    assert value(far, "right_of_way_violations", given) == 0.0
    assert value(gone, "right_of_way_violations", given) == 0.0
    assert value(both, "right_of_way_violations", given) == 2.0


def test_one_that_stands_is_not_forced_to_brake_by_an_ego_that_stays_in_its_way() -> None:
    slow = rollout(Mover(0.5 - HALF_M - 0.5 * 2.5, -1.5, 0.0, 0.5), Mover(1.5, -8.0, math.pi / 2))

    assert value(slow, "right_of_way_violations", context()) == 0.0


def test_who_has_red_has_no_priority() -> None:
    given = context(lights=True, start_s=0.0)
    ego = Mover(0.5 - HALF_M - 8.0 * 2.5, -1.5, 0.0, 8.0)
    late = rollout(ego, Mover(1.5, -33.0, math.pi / 2, 10.0))

    assert value(late, "right_of_way_violations", given) == 0.0
    assert value(late, "right_of_way_violations", context()) == 1.0


def from_south(front_m: float) -> Mover:
    """At 10 m/s, so far from the shared ground when the ego comes onto it after 2.5 s."""
    return Mover(1.5, -2.5 - 2.0 - front_m - 25.0, math.pi / 2, 10.0)


@pytest.mark.parametrize("until_s", [2.6, 3.0, 8.0])
def test_an_ego_that_is_still_on_its_way_off_as_the_future_ends_goes_on(until_s: float) -> None:
    """It would be off the shared ground after (length + 2 m) / 8, long before who is 22 m away."""
    ego = Mover(0.5 - HALF_M - 8.0 * 2.5, -1.5, 0.0, 8.0)
    far = rollout(ego, from_south(22.0), time_s=times(until_s))
    near = rollout(ego, from_south(8.0), time_s=times(until_s))

    assert value(far, "right_of_way_violations", context()) == 0.0
    assert value(near, "right_of_way_violations", context()) == 1.0


@pytest.mark.parametrize("crashes", [True, False])
def test_an_ego_that_stands_on_the_shared_ground_is_in_the_way(crashes: bool) -> None:
    """Be it that it stopped there, or that it hit somebody there."""
    ego = Mover(0.5 - HALF_M - 8.0 * 2.5, -1.5, 0.0, 8.0)
    driven = rollout(ego, from_south(24.0), time_s=times(5.0))
    assert value(driven, "right_of_way_violations", context()) == 0.0

    ended = driven._replace(last=np.array([27]))
    if not crashes:
        ended = driven._replace(states=driven.states.copy())
        ended.states[0, 28:] = ended.states[0, 27]
        ended.states[0, 27:, 3] = 0.0
    assert value(ended, "right_of_way_violations", context()) == 1.0
