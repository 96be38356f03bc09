"""What counts against a sensor, and what says nothing of it."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from foretwin.telemetry.estimator.chords import Chord
from foretwin.telemetry.estimator.credibility import (
    Credibility,
    ForceCredibility,
    HeadingCredibility,
    TurningCredibility,
    WayCredibility,
)


def chord(number: int, *, course_rad: float = 0.0, length_m: float = 10.0) -> Chord:
    return Chord(float(number), number + 1.0, length_m, course_rad)


def test_the_first_contradiction_ends_the_belief_in_what_nothing_bore_out() -> None:
    credibility = Credibility()
    credibility.weigh([False, False])
    assert not credibility.holds
    for _ in range(2):
        credibility.weigh([True, True])
        assert not credibility.holds
    credibility.weigh([True])
    assert credibility.holds


def test_what_was_borne_out_must_be_contradicted_three_times_more() -> None:
    credibility = Credibility()
    for fits in (True, True, True, False, True, False, False):
        credibility.weigh([fits])
        assert credibility.holds
    credibility.weigh([False])
    assert not credibility.holds


def test_what_fits_if_positions_are_late_says_nothing() -> None:
    credibility = Credibility()
    for _ in range(9):
        credibility.weigh([False, True])
    assert credibility.holds


def test_a_receiver_that_jumps_turns_one_chord_and_a_car_all_that_follow() -> None:
    jumps, turns = TurningCredibility(), TurningCredibility()
    for number in range(30):
        jumps.take(chord(number, course_rad=1.2 * (number % 7 == 3)), (0.0,))
        turns.take(chord(number, course_rad=1.2 * (number >= 3)), (0.0,))
    assert (jumps.holds, turns.holds) == (True, False)


def test_a_bend_one_way_and_then_the_other_is_a_turn_of_both() -> None:
    """As out of a roundabout: a reversed gyro that may be late by seconds fits none of it."""
    courses = [0.0] * 10 + [-0.35, -0.7, -0.7, -0.35, 0.0, 0.35, 0.7, 0.7] + [0.2] * 5
    reversed_, late = TurningCredibility(), TurningCredibility()
    for number, course_rad in enumerate(courses):
        lags = tuple(courses[max(number - lag, 0)] for lag in range(4))
        ahead = tuple(courses[min(max(number + 2 - lag, 0), 22)] for lag in range(4))
        reversed_.take(chord(number, course_rad=course_rad), tuple(-one for one in lags))
        late.take(chord(number, course_rad=course_rad), ahead)
    assert (reversed_.holds, late.holds) == (False, True)


def test_a_car_that_goes_to_and_fro_says_nothing_of_its_gyro() -> None:
    credibility = TurningCredibility()
    for number in range(30):
        credibility.take(chord(number, course_rad=math.pi * (number // 5 % 2)), (0.0,))
    assert credibility.holds


def test_courses_that_swing_to_and_fro_are_a_rough_receivers_and_say_nothing() -> None:
    """As between houses, where reflected signals put fixes 30 m off."""
    credibility = TurningCredibility()
    for number, degrees in enumerate((160, 192, 257, 183, 259, 200, 270, 190, 280, 275, 265)):
        credibility.take(chord(number, course_rad=math.radians(degrees)), (0.0,))
    assert credibility.holds


def test_how_a_car_turned_round_where_no_chord_tells_says_nothing_of_its_gyro() -> None:
    """As in a car park: it turned by 4.5 rad at walking pace, the short way round -1.8 rad."""
    credibility = TurningCredibility()
    for number in range(5):
        credibility.take(chord(number), (0.0,))
    for number in range(9, 14):
        credibility.take(chord(number, course_rad=4.5 - math.tau + 0.4), (4.9,))
    assert credibility.holds


@pytest.mark.parametrize(("times", "holds"), [(0.0, False), (0.9, True), (1.8, True), (3.6, False)])
def test_wheels_go_as_far_as_positions(times: float, holds: bool) -> None:
    credibility = WayCredibility()
    for number in range(9):
        credibility.take(chord(number), (10.0 * times,))
    assert credibility.holds == holds


def test_a_single_jump_of_the_receiver_is_no_way() -> None:
    credibility = WayCredibility()
    for number in range(30):
        credibility.take(chord(number, length_m=50.0 if number % 3 == 1 else 3.0), (0.0,))
    assert credibility.holds


@pytest.mark.parametrize(("length_m", "holds"), [(2.0, True), (10.0, False)])
def test_a_car_backs_slowly(length_m: float, holds: bool) -> None:
    credibility = WayCredibility()
    for number in range(40):
        credibility.take(chord(number, length_m=length_m), (-length_m,))
    assert credibility.holds == holds


@pytest.mark.parametrize("backs", [True, False])
def test_a_car_that_backs_points_the_other_way(backs: bool) -> None:
    credibility = HeadingCredibility()
    for number in range(9):
        credibility.take(chord(number), (math.pi,), backs=backs)
    assert credibility.holds == backs


def test_out_of_a_parking_space_a_car_backs_for_some_metres() -> None:
    credibility = HeadingCredibility()
    for number in range(9):
        credibility.take(
            chord(number, length_m=5.0), (math.pi if number < 4 else 0.0,), backs=False
        )
    assert credibility.holds


def speed_mps(time_s: float) -> float:
    """From a standstill up to 10 m/s in five seconds, on for five, and down again in five."""
    return 2.0 * min(max(time_s, 0.0), 5.0) - 2.0 * min(max(time_s - 10.0, 0.0), 5.0)


def pushed(felt_mps: Callable[[float], float], *, std_mps: float = 0.0, swing: float = 1.0) -> bool:
    """Whether forces that sum up so are believed beside speeds that vary `swing` times as much."""
    credibility = ForceCredibility()
    for k in range(40):
        time_s = 0.5 * k
        late = tuple(felt_mps(time_s - late_s) for late_s in (0.0, 1.0, 2.0, 3.0))
        credibility.take(time_s, swing * speed_mps(time_s), late, std_mps=std_mps)
    return credibility.holds


@pytest.mark.parametrize(
    ("told", "felt_mps", "holds"),
    [
        ("truly", speed_mps, True),
        ("with a bias, or up a hill", lambda time_s: speed_mps(time_s) - 1.5 * time_s, True),
        ("a fifth too much", lambda time_s: 1.2 * speed_mps(time_s), True),
        ("before positions that are late", lambda time_s: speed_mps(time_s + 2.0), True),
        ("stuck", lambda _: 0.0, False),
        ("in g", lambda time_s: speed_mps(time_s) / 9.8, False),
        ("backwards", lambda time_s: -speed_mps(time_s), False),
        ("late", lambda time_s: speed_mps(time_s - 2.0), False),
    ],
)
def test_forces_sum_up_to_speeds(
    told: str, felt_mps: Callable[[float], float], holds: bool
) -> None:
    assert pushed(felt_mps) == holds, told


def test_speeds_that_hardly_vary_or_are_rough_say_nothing_of_forces() -> None:
    assert pushed(lambda _: 0.0, swing=0.3)
    assert pushed(lambda _: 0.0, std_mps=2.0)


def test_what_was_felt_over_a_gap_is_not_known() -> None:
    credibility = ForceCredibility()
    for k in range(40):
        felt_mps = None if k % 5 == 0 else 4 * (0.0,)
        credibility.take(0.5 * k, speed_mps(0.5 * k), felt_mps, std_mps=0.0)
    assert credibility.holds


def test_how_late_speeds_are_is_not_known_as_a_drive_begins() -> None:
    credibility = ForceCredibility()
    for k in range(40):
        credibility.take(0.5 * k, speed_mps(0.5 * k), (0.0, 0.0), std_mps=0.0)
    assert credibility.holds


def test_rough_speeds_contradict_forces_where_they_are_plainly_wrong() -> None:
    assert not pushed(lambda time_s: 2.5 * speed_mps(time_s))
    assert pushed(lambda time_s: 2.5 * speed_mps(time_s), std_mps=0.1)
    assert not pushed(lambda time_s: -speed_mps(time_s), std_mps=0.1)
