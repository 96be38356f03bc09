"""What a step is worth, by hand, and that standing still is never the best to be had."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.sim_worker.driver_model import BRISK_TIME_GAP_S, STANDSTILL_GAP_M
from foretwin.sim_worker.gym.reward import (
    ARRIVED,
    COLLISION,
    COMFORT_SHARE,
    DID_NOT_WAIT,
    DISTANCE_SHARE,
    OFF_ROAD,
    PROGRESS_PER_M,
    RAN_RED,
    SPEED_PER_MPS,
    SPEEDING_PER_M,
    default_reward,
)
from foretwin.sim_worker.gym.rows import StepFacts

STEADY = StepFacts(
    0.1,
    *(np.array([v]) for v in (0.8, 8.0, 0.0, 8.0, 0.0, 0.0, 0.0, 8.0, 0.0, 1.0)),
    *(np.zeros((6, 1), dtype=bool)),
)
QUIET = 0.8 * PROGRESS_PER_M
DISCOUNT, TICK_S = 0.99, 0.1


def worth(**changed: float) -> float:
    facts = STEADY._replace(**{name: np.array([value]) for name, value in changed.items()})
    return float(default_reward(facts)[0])


def test_steady_driving_pays_metres_and_speed_only_up_to_a_tenth_above_the_target() -> None:
    assert worth() == pytest.approx(QUIET)
    assert worth(speed_mps=8.8) == pytest.approx(QUIET)
    over = (10.8 - 1.1 * 8.0) * TICK_S
    assert worth(speed_mps=10.8) == pytest.approx(QUIET + over * SPEEDING_PER_M)
    # The two metres a second that were too many paid as much as they cost.
    assert worth(speed_mps=10.8, progress_m=1.08) <= worth(progress_m=0.88) + 1e-12


def test_discomfort_takes_a_share_of_the_metres_and_nothing_of_who_stands() -> None:
    gentle, hard = QUIET - worth(accel_mps2=3.0), QUIET - worth(lateral_accel_mps2=-6.0)
    assert hard == pytest.approx(4.0 * gentle)
    assert worth(jerk_mps3=1e6, accel_mps2=-50.0) == pytest.approx((1.0 - COMFORT_SHARE) * QUIET)
    assert worth(jerk_mps3=1e6, speed_mps=0.0, progress_m=0.0) == 0.0


def test_a_metre_driven_without_distance_is_worth_little_and_more_than_none() -> None:
    assert worth(distance_share=0.0) == pytest.approx((1.0 - DISTANCE_SHARE) * QUIET)
    assert worth(distance_share=0.5) == pytest.approx((1.0 - DISTANCE_SHARE / 2.0) * QUIET)
    # Discomfort takes its share of what is left: there is always something left.
    worst = worth(distance_share=0.0, jerk_mps3=1e6)
    assert worst == pytest.approx((1.0 - DISTANCE_SHARE) * (1.0 - COMFORT_SHARE) * QUIET)
    assert worst > 0.0
    assert worth(distance_share=0.0, speed_mps=0.0, progress_m=0.0) == 0.0


def test_who_is_too_close_is_ahead_by_falling_back() -> None:
    """At 6 m/s, 3 m behind another who is as fast: for the next 3 s, discounted."""
    wanted_m = STANDSTILL_GAP_M + BRISK_TIME_GAP_S * 6.0
    steps = np.arange(30)
    stays = [worth(progress_m=0.6, speed_mps=6.0, distance_share=3.0 / wanted_m)] * len(steps)
    # It brakes by 1 m/s for as long as it takes, and then accelerates again.
    speed = np.where(steps < 10, 6.0 - 0.1 * steps, np.minimum(5.0 + 0.1 * (steps - 10), 6.0))
    gap = 3.0 + np.cumsum(6.0 - speed) * TICK_S
    falls = [
        worth(
            progress_m=v * TICK_S,
            speed_mps=v,
            speed_gain_mps=gain,
            accel_mps2=gain / TICK_S,
            distance_share=min(d / wanted_m, 1.0),
        )
        for v, gain, d in zip(speed, np.diff(speed, prepend=6.0), gap, strict=True)
    ]
    discounts = DISCOUNT**steps
    assert np.array(falls) @ discounts > np.array(stays) @ discounts


def test_speed_counts_up_to_what_the_bend_allows_and_too_much_is_lost_as_it_comes() -> None:
    into = worth(speed_mps=8.0, aimed_speed_mps=6.0, aimed_gain_mps=-0.5, progress_m=0.8)
    assert into == pytest.approx(
        QUIET - 0.5 * SPEED_PER_MPS + (8.0 - 6.6) * TICK_S * SPEEDING_PER_M
    )
    # Who slows down with the bend loses the same speed, and metres are not spoilt.
    slows = worth(speed_mps=6.0, speed_gain_mps=-0.5, aimed_speed_mps=6.0, aimed_gain_mps=-0.5)
    assert slows == pytest.approx(QUIET - 0.5 * SPEED_PER_MPS)


def test_events_settle_once_each() -> None:
    assert worth(collided=True) == pytest.approx(QUIET + COLLISION)
    assert worth(off_road=True, failed=True) == pytest.approx(QUIET + OFF_ROAD)
    # What the crash takes off the speed is no loss of potential on top.
    assert worth(collided=True, speed_gain_mps=-6.0) == pytest.approx(QUIET + COLLISION)
    assert worth(arrived=True) == pytest.approx(QUIET + ARRIVED)
    assert worth(ran_red=True) == pytest.approx(QUIET + RAN_RED)
    assert worth(did_not_wait=True) == pytest.approx(QUIET + DID_NOT_WAIT)


@given(st.lists(st.floats(-0.8, 0.3), min_size=1, max_size=80))
def test_over_an_episode_metres_and_speed_sum_to_where_it_ends(gains: list[float]) -> None:
    """A potential's: whatever happens on the way, but for what comfort takes."""
    total = speed = way = comfort = 0.0
    for gain in gains:
        before, speed = speed, min(max(speed + gain, 0.0), 8.0)
        step_m = speed * TICK_S
        way += step_m
        jerk = 7.0
        total += worth(
            progress_m=step_m, speed_mps=speed, speed_gain_mps=speed - before, jerk_mps3=jerk
        )
        comfort += COMFORT_SHARE * PROGRESS_PER_M * step_m * (jerk / 14.0) ** 2
    ends = PROGRESS_PER_M * way + SPEED_PER_MPS * speed
    assert total == pytest.approx(ends - comfort, abs=1e-9)


def driven(metres: float, speed_mps: float, end: str | None, *, roughly: bool = True) -> float:
    """The discounted worth of driving so far from a standstill, as roughly as can be."""
    step_m = speed_mps * TICK_S
    steps = round(metres / step_m)
    jerk = 1e6 if roughly else 0.0
    each = [worth(progress_m=step_m, speed_mps=speed_mps, jerk_mps3=jerk)] * steps
    each[0] += SPEED_PER_MPS * speed_mps
    if end is not None:
        each[-1] = worth(progress_m=step_m, speed_mps=speed_mps, jerk_mps3=jerk, **{end: True})
    return float(np.sum(np.array(each) * DISCOUNT ** np.arange(steps)))


@pytest.mark.parametrize("speed_mps", [1.0, 3.0, 6.0, 8.0])
@pytest.mark.parametrize("metres", [5.0, 30.0, 100.0, 400.0])
def test_standing_still_never_pays(metres: float, speed_mps: float) -> None:
    stands = worth(progress_m=0.0, speed_mps=0.0)
    assert stands == 0.0
    assert driven(metres, speed_mps, None) > 0.0
    assert driven(metres, speed_mps, "arrived") >= driven(metres, speed_mps, None)
    # Even who crashes after some way is ahead of who never begins, and far behind who arrives.
    if metres >= 30.0 and speed_mps >= 3.0:
        assert driven(metres, speed_mps, "collided") > 0.0


def test_sixty_metres_before_the_end_the_numbers_are_those_of_the_reasons_given() -> None:
    """V / (V + C), and who waits 3 s against who risks a crash: in the module's docstring."""
    remains = driven(60.0, 6.0, "arrived", roughly=False) - SPEED_PER_MPS * 6.0
    crash = -COLLISION

    assert remains == pytest.approx(2.2, abs=0.1)
    assert remains / (remains + crash) == pytest.approx(0.73, abs=0.02)
    waiting = (1.0 - DISCOUNT**30) * remains
    assert waiting / (remains + crash) == pytest.approx(0.19, abs=0.01)
