"""Positions once a second that are rough from one to the next, as without any smoothing."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.contracts.drive import HeadingSample, SpeedSample, VehicleState
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.telemetry.position_track import fix, info, xy

SPEED_MPS, SECONDS = 10.0, 120


class Errors(NamedTuple):
    """What 95 % of the states after the first half minute are within."""

    position_m: float
    yaw_deg: float


def straight_on(
    *, rough_m: float, stated_m: float | None, seed: int, headings: bool = False
) -> Errors:
    """Drive east with true wheels, and where told with headings good to a degree."""
    estimator, random = StateEstimator(info()), np.random.default_rng(seed)
    found = []
    for second in range(SECONDS):
        stamp_ns, x_m = second * 10**9, SPEED_MPS * second
        estimator.handle("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=SPEED_MPS))
        if headings:
            told = random.normal(0.0, math.radians(1.0))
            estimator.handle("heading", HeadingSample(stamp_ns=stamp_ns, yaw_rad=told))
        off_m = random.normal(0.0, rough_m, 2)
        state = estimator.handle(*fix(float(second), x_m + off_m[0], off_m[1], stated_m))
        if state is not None and second >= 30:
            away_m = float(np.hypot(*(xy(state) - (x_m, 0.0))))
            found.append((away_m, math.degrees(abs(state.yaw_rad))))
    return Errors(*np.percentile(found, 95, axis=0).tolist())


@pytest.mark.parametrize("stated_m", [2.1, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_wheels_do_not_make_them_worse(seed: int, stated_m: float) -> None:
    """The fixes are within 5.1 m; a filter that took their noise for turns was 20 m off."""
    errors = straight_on(rough_m=2.1, stated_m=stated_m, seed=seed)

    assert errors.position_m < 6.0
    assert errors.yaw_deg < 35.0


@pytest.mark.parametrize("rough_m", [0.5, 1.0, 2.1])
def test_headings_beside_them_are_believed(rough_m: float) -> None:
    """A filter that is unsure of its yaw does not take that for noise of the headings."""
    errors = straight_on(rough_m=rough_m, stated_m=rough_m, seed=1, headings=True)

    assert errors.yaw_deg < 3.0
    assert errors.position_m < 2.5 * rough_m  # no farther than the fixes


def round_the_block(*, rough_m: float, seed: int) -> Errors:
    """Drive at up to 12 m/s, and slowly to the left into the next street, again and again."""
    estimator, random = StateEstimator(info()), np.random.default_rng(seed)
    x_m = y_m = yaw_rad = 0.0
    found = []
    for tick in range(10 * SECONDS):
        time_s = 0.1 * tick
        speed_mps = 8.5 + 3.5 * math.cos(math.tau * time_s / 12.0)
        estimator.handle("speed", SpeedSample(stamp_ns=tick * 10**8, speed_mps=speed_mps))
        if tick % 10 == 0:
            off_m = random.normal(0.0, rough_m, 2)
            state = estimator.handle(*fix(time_s, x_m + off_m[0], y_m + off_m[1], rough_m))
            if state is not None and time_s >= 30.0:
                turned = math.remainder(state.yaw_rad - yaw_rad, math.tau)
                away_m = float(np.hypot(*(xy(state) - (x_m, y_m))))
                found.append((away_m, math.degrees(abs(turned))))
        yaw_rad += 0.1 * 0.7 * (5.0 <= time_s % 12.0 < 7.2)
        x_m += 0.1 * speed_mps * math.cos(yaw_rad)
        y_m += 0.1 * speed_mps * math.sin(yaw_rad)
    return Errors(*np.percentile(found, 95, axis=0).tolist())


def test_who_turns_is_found_again_by_the_next_fixes() -> None:
    """Wheels do not say that the car turns, and fixes of 2.1 m hardly: it was 16 to 35 m off."""
    found = [round_the_block(rough_m=2.1, seed=seed) for seed in range(4)]

    assert np.mean([errors.position_m for errors in found]) < 9.0
    assert np.mean([errors.yaw_deg for errors in found]) < 70.0


@pytest.mark.parametrize("stated_m", [5.0, None])
@pytest.mark.parametrize("seed", range(4))
def test_wheels_are_believed_beside_fixes_that_jump_about_a_car_that_pulls_away(
    seed: int, stated_m: float | None
) -> None:
    """Jumps of 10 m and more are no way of the car's: true wheels were left out from then on."""
    estimator, random = StateEstimator(info()), np.random.default_rng(seed)
    for tick in range(600):
        time_s = 0.1 * tick
        speed_mps = min(0.7 * time_s, SPEED_MPS)
        estimator.handle("speed", SpeedSample(stamp_ns=tick * 10**8, speed_mps=speed_mps))
        if tick % 10 == 0:
            at_m = speed_mps * (time_s - 0.5 * speed_mps / 0.7)
            off_m = random.normal(0.0, 5.0, 2)
            estimator.handle("heading", HeadingSample(stamp_ns=tick * 10**8, yaw_rad=0.0))
            estimator.handle(*fix(time_s, at_m + off_m[0], off_m[1], stated_m))

    assert estimator.left_out == frozenset()


@pytest.mark.parametrize("stated_m", [3.0, None])
def test_speeds_of_fixes_whose_error_wanders_are_told_as_unsure_as_they_are(
    stated_m: float | None,
) -> None:
    """By a second later 3 m of error have changed by 0.8 m: 76 of 100 speeds were within 95 %, and
    47 where nothing is stated and that was taken for what the car jerks."""
    within = []
    for seed in range(6):
        estimator, random = StateEstimator(info()), np.random.default_rng(seed)
        off_m, stays = random.normal(0.0, 3.0, 2), math.exp(-1.0 / 30.0)
        for second in range(SECONDS):
            off_m = stays * off_m + math.sqrt(1.0 - stays**2) * random.normal(0.0, 3.0, 2)
            x_m, y_m = off_m + random.normal(0.0, 0.3, 2)
            state = estimator.handle(*fix(float(second), SPEED_MPS * second + x_m, y_m, stated_m))
            if state is not None and second >= 30:
                assert state.speed_std_mps is not None
                within.append(abs(state.speed_mps - SPEED_MPS) < 1.96 * state.speed_std_mps)

    assert np.mean(within) > (0.85 if stated_m else 0.65)


def first_states(nth: int) -> tuple[float, float]:
    """Return the shares of speeds and yaws of the nth state that are within their 95 %."""
    within = []
    for seed in range(60):
        estimator, random = StateEstimator(info()), np.random.default_rng(seed)
        states: list[VehicleState] = []
        for second in range(SECONDS):
            x_m, y_m = random.normal(0.0, 5.0, 2)
            state = estimator.handle(*fix(float(second), SPEED_MPS * second + x_m, y_m, 5.0))
            states += [state] if state is not None and state.yaw_valid else []
            if len(states) == nth:
                break
        told = states[-1]
        assert told.speed_std_mps is not None
        assert told.yaw_std_rad is not None
        fast = abs(told.speed_mps - SPEED_MPS) < 1.96 * told.speed_std_mps
        within.append((fast, abs(told.yaw_rad) < 1.96 * told.yaw_std_rad))
    speeds, yaws = np.mean(within, axis=0).tolist()
    return speeds, yaws


def test_the_first_rough_fixes_may_differ_by_all_that_they_state() -> None:
    """A tenth of it was expected before any had shown its noise: 55 of 100 speeds were within."""
    speeds, _ = first_states(3)

    assert speeds > 0.8


def test_a_motion_begins_as_unsure_as_two_rough_fixes_tell_it() -> None:
    """Speeds were called known within 1 m/s, courses within 8.6°: 5 and 63 of 100 were within."""
    speeds, yaws = first_states(1)

    assert speeds > 0.75
    assert yaws > 0.85
