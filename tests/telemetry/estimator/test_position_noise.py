"""What is learnt of a receiver's noise, with and without its word."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.drive import GnssFix
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.estimator.position_noise import LEAST_STD_M, UNKNOWN_STD_M, PositionNoise


def fix(std_m: float | None = None) -> GnssFix:
    return GnssFix(stamp_ns=0, position=GeoPoint(52.0, 13.0), std_m=std_m)


def driven(std_m: float, *, rate_hz: float = 5.0, count: int = 60, seed: int = 1) -> PositionNoise:
    """What a car is seen with that brakes from 12 m/s by 2 m/s² in a bend, again and again."""
    noise, random = PositionNoise(), np.random.default_rng(seed)
    for k in range(count):
        t = k / rate_hz
        way_m = 8.0 * t + 2.0 * np.sin(t)
        at = 40.0 * np.array([np.cos(way_m / 40.0), np.sin(way_m / 40.0)])
        noise.take(t, at + random.normal(0.0, std_m, 2))
    return noise


def test_before_the_car_has_moved_a_fix_is_taken_for_middling_and_never_for_a_centimetre() -> None:
    assert PositionNoise().std_m(fix()) == UNKNOWN_STD_M
    assert driven(0.0).std_m(fix()) == LEAST_STD_M


@pytest.mark.parametrize("std_m", [0.1, 0.5, 2.0])
def test_noise_that_nobody_states_is_learnt(std_m: float) -> None:
    found = [driven(std_m, seed=seed).std_m(fix()) for seed in range(12)]
    assert np.median(found) == pytest.approx(std_m, rel=0.3)


def test_a_stated_error_that_lies_by_a_hundred_is_overruled_and_an_honest_one_is_not() -> None:
    noise = driven(2.0)
    assert noise.std_m(fix(0.02)) == pytest.approx(2.0, rel=0.5)
    assert driven(0.02).std_m(fix(0.02)) == 0.02
    assert driven(0.02).std_m(fix(0.1)) == 0.1


def test_fixes_once_a_second_are_not_held_for_noise_because_the_car_moves() -> None:
    assert driven(0.05, rate_hz=1.0).std_m(fix(0.3)) == 0.3


def test_of_a_rough_receiver_with_smooth_fixes_only_the_noise_is_small() -> None:
    noise = driven(0.02)
    assert noise.std_m(fix(2.0)) == 2.0
    assert noise.white_std_m(fix(2.0)) < 0.05
    assert PositionNoise().white_std_m(fix(2.0)) == 2.0  # nobody knows yet


def test_a_receiver_that_becomes_worse_is_found_out_within_five_fixes() -> None:
    noise, random = driven(0.02), np.random.default_rng(2)
    for k in range(5):
        noise.take(12.0 + 0.2 * k, np.array([3.0 * k, 0.0]) + random.normal(0.0, 2.0, 2))
    assert noise.std_m(fix()) > 0.5


def test_a_standing_car_teaches_nothing_and_a_copy_goes_on_by_itself() -> None:
    noise = driven(0.3)
    other, before = noise.copy(), noise.std_m(fix())
    other.restart()
    for k in range(40):
        other.take(20.0 + 0.2 * k, np.zeros(2))
    assert other.std_m(fix()) == before
    other.restart()
    for k in range(40):
        other.take(30.0 + 0.2 * k, np.array([2.0 * k, 0.0]))
    assert other.std_m(fix()) < noise.std_m(fix()) == before


def test_a_car_that_stands_shows_the_jitter_of_fixes_that_were_rough_on_the_move() -> None:
    noise, random = driven(0.5), np.random.default_rng(4)
    rough = noise.still_std_m(fix())
    assert rough == noise.white_std_m(fix())
    for k in range(14):
        noise.take(12.0 + 0.2 * k, np.array([9.0, 0.0]) + random.normal(0.0, 0.02, 2))
    assert noise.still_std_m(fix()) == pytest.approx(0.03, abs=0.02)
    assert noise.white_std_m(fix()) > 0.2, "on the move it is as rough as it was"


def test_a_receiver_that_states_nothing_may_be_metres_off_until_it_has_hardly_jittered() -> None:
    assert PositionNoise().hidden_std_m(fix()) == 2.0, "nobody has seen it yet"
    assert driven(0.003).hidden_std_m(fix()) == 0.0
    assert driven(0.003, count=20).hidden_std_m(fix()) == 2.0, "too few to tell"
    assert driven(0.03).hidden_std_m(fix()) == 2.0
    assert driven(0.6, rate_hz=1.0).hidden_std_m(fix()) == pytest.approx(6.0, rel=0.5)
    assert driven(0.03).hidden_std_m(fix(0.02)) == 0.0, "that is as large as it states"


def test_fixes_too_seldom_to_tell_noise_from_jerks_are_not_taken_for_precise() -> None:
    """Once a second a car that brakes in bends leaves 0.9 m beyond the quadratic, noise or not."""
    found = [driven(0.5, rate_hz=1.0, seed=seed).std_m(fix()) for seed in range(12)]
    assert 0.2 < np.median(found) < 1.0
    assert driven(0.5, rate_hz=1.0).std_m(fix(0.3)) == 0.3, "that is not disproved"


def test_a_slow_error_is_another_one_by_the_next_fix() -> None:
    """Of two fixes a second apart, each with an error of 3 m that stays alike over 30 s."""
    difference_m = math.sqrt(2.0 * 3.0**2 * (1.0 - math.exp(-1.0 / 30.0)) + 2.0 * 0.3**2)
    apart_m = driven(0.0, rate_hz=1.0).apart_std_m(fix(3.0))
    assert apart_m == pytest.approx(difference_m / math.sqrt(2.0))
    assert driven(0.0, rate_hz=1.0).apart_std_m(fix(0.3)) == 0.3


def test_a_receiver_that_loses_its_corrections_is_metres_off_once_it_has_shown_that() -> None:
    noise, random = driven(0.003, count=120), np.random.default_rng(7)
    for k in range(120):
        noise.take(24.0 + 0.2 * k, np.array([3.0 * k, 0.0]) + random.normal(0.0, 0.05, 2))
    assert noise.hidden_std_m(fix()) == 2.0


def test_where_the_filter_knows_little_no_surprise_shows_that_fixes_are_good() -> None:
    seldom, random = driven(0.3, rate_hz=1.0), np.random.default_rng(5)
    for away_m in np.hypot(*random.normal(0.0, 1.0, (2, 24))):
        seldom.surprised(float(away_m), 1.5**2)
    seldom.take(60.0, np.zeros(2))
    assert seldom.seen_m == 0.0
    assert 0.3 < seldom.std_m(fix()) < 1.0
    assert seldom.std_m(fix(0.02)) == 0.02  # what is stated is not disproved by it


def test_where_the_filter_knows_well_surprises_show_good_fixes() -> None:
    noise, random = driven(0.0), np.random.default_rng(6)
    for away_m in np.hypot(*random.normal(0.0, 0.02, (2, 24))):
        noise.surprised(float(away_m), 0.02**2)
    assert noise.std_m(fix()) == LEAST_STD_M


@pytest.mark.parametrize("none", [math.inf, math.nan])
def test_an_error_that_is_no_number_is_none_that_is_stated(none: float) -> None:
    for noise in (PositionNoise(), driven(0.02), driven(1.0)):

        def told(std_m: float | None, of: PositionNoise = noise) -> tuple[object, ...]:
            ways = (of.std_m, of.white_std_m, of.hidden_std_m, of.sure_white_std_m, of.wanders)
            return tuple(way(fix(std_m)) for way in ways)

        assert told(none) == told(None)
