"""What a leader asks for that brakes, against what just avoids it."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.driver_model import MAX_DECEL_MPS2
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Rollout
from tests.sim_worker.metrics.motions import LENGTH_M, Mover, rollout, times

COVERS = ("foretwin.sim_worker.metrics.following",)

EGO_MPS, BRAKES_MPS2 = 10.0, 6.0


def behind(gap_m: float, speed_mps: Array, time_s: Array) -> Rollout:
    """10 m/s, behind a car of 4 m that drives at speeds (N,)."""
    ahead = LENGTH_M / 2 + gap_m + 2.0
    drawn = rollout(Mover(0, 0, 0, EGO_MPS), Mover(ahead, 0, 0, 0), time_s=time_s)
    mean_mps = (speed_mps[1:] + speed_mps[:-1]) / 2
    drawn.users[0, 1:, 0, 0] += np.cumsum(mean_mps * np.diff(time_s))
    drawn.user_speed_mps[0, :, 0] = speed_mps
    return drawn


def needed(driven: Rollout) -> float:
    found = evaluate(driven, ("required_deceleration", "required_acceleration", "btn"))
    brakes = found["required_deceleration"].values
    assert found["btn"].values * MAX_DECEL_MPS2 == pytest.approx(brakes)
    assert (found["required_acceleration"].values >= brakes).all()
    return float(brakes[0])


def touches(gap_m: float, leader_mps: float, brakes_mps2: float) -> bool:
    """Whether the ego, braking so hard, meets a leader that brakes until it stands."""
    time_s = np.linspace(0.0, 60.0, 60001)

    def gone_m(speed_mps: float, rate_mps2: float) -> Array:
        until = np.minimum(time_s, speed_mps / rate_mps2)
        return speed_mps * until - rate_mps2 * until**2 / 2

    left_m = gap_m + gone_m(leader_mps, BRAKES_MPS2) - gone_m(EGO_MPS, brakes_mps2)
    return bool((left_m < 0.0).any())


@pytest.mark.parametrize("leader_mps", [3.0, 6.0, 9.0, 9.9])
@pytest.mark.parametrize("gap_m", [0.2, 1.0, 4.0, 20.0, 60.0])
def test_so_much_just_avoids_who_brakes_until_it_stands(gap_m: float, leader_mps: float) -> None:
    time_s = times(0.1)
    asked = needed(behind(gap_m, leader_mps - BRAKES_MPS2 * time_s, time_s)._replace(
        last=np.array([0])
    ))  # fmt: skip

    assert touches(gap_m, leader_mps, 0.99 * asked)
    assert not touches(gap_m, leader_mps, 1.001 * asked)


def test_who_comes_to_stand_far_ahead_asks_for_no_more_than_to_stop_there() -> None:
    """60 m and a stop later, 1 m/s² is enough: it never drives backwards."""
    time_s = times(2.0, 0.05)
    driven = behind(60.0, np.maximum(10.0 - BRAKES_MPS2 * time_s, 0.0), time_s)
    gap_m = 60.0 + 100.0 / (2 * BRAKES_MPS2) - EGO_MPS * 2.0

    assert needed(driven) == pytest.approx(EGO_MPS**2 / (2 * gap_m), rel=0.02)


def test_noise_in_a_leaders_speed_is_not_its_braking() -> None:
    """White noise of 0.1 m/s gives differences of two instants of 0.7 m/s²."""
    random, time_s = np.random.default_rng(0), times()
    driven = behind(25.0, np.full(len(time_s), 9.8), time_s)
    noisy = driven._replace(
        user_speed_mps=driven.user_speed_mps + random.normal(0.0, 0.1, (1, len(time_s), 1))
    )

    assert needed(noisy) < 0.5


def test_of_who_comes_and_goes_the_speeds_that_there_are_count() -> None:
    time_s = times(1.0)
    driven = behind(20.0, 9.0 - 2.0 * time_s, time_s)
    whole = needed(driven._replace(last=np.array([5])))
    for gone in (slice(0, 5), slice(6, None)):
        part = driven._replace(
            users=driven.users.copy(), user_speed_mps=driven.user_speed_mps.copy(),
            last=np.array([5]),
        )  # fmt: skip
        part.users[0, gone], part.user_speed_mps[0, gone] = np.nan, np.nan
        assert needed(part) == pytest.approx(whole, rel=0.1)
