"""What states tell of their errors comes to hold 95 of 100 of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.telemetry.estimator.kinematic_filter import SPEED, KinematicFilter, X, Y
from foretwin.telemetry.estimator.told_spreads import Stretched, ToldSpreads

RATE_HZ = 5.0
RADIUS_M, SPEED_MPS = 40.0, 10.0


def driven(
    *,
    speed_off_mps: float = 0.0,
    yaw_off_rad: float = 0.0,
    place_off_m: float = 0.0,
    noise_m: float | None = 0.005,
    rate_hz: float = RATE_HZ,
    heading: bool = False,
    speed_mps: float = SPEED_MPS,
) -> tuple[Stretched, float]:
    """A bend with states that are off by so much and tell 0.1 m/s, 0.02 rad and 0.05 m.

    Returns what is told of it at last, and what share of speeds was within it.
    """
    told, random = ToldSpreads(), np.random.default_rng(3)
    within = []
    for k in range(round(120.0 * rate_hz)):
        turned = speed_mps / RADIUS_M * k / rate_hz
        at = RADIUS_M * np.array([math.sin(turned), 1.0 - math.cos(turned)])
        off_mps = random.normal(0.0, speed_off_mps)
        filter_ = KinematicFilter(
            xy_m=at + random.normal(0.0, place_off_m, 2),
            yaw_rad=turned + random.normal(0.0, yaw_off_rad),
            speed_mps=speed_mps + off_mps,
            yaw_std_rad=0.02,
        )
        filter_.covariance[SPEED, SPEED] = 0.1**2
        filter_.covariance[X, X] = filter_.covariance[Y, Y] = 0.05**2
        within.append(abs(off_mps) < 1.96 * 0.1 * told.stretched.speed)
        fix = at + random.normal(0.0, noise_m or 0.0, 2)
        told.take(
            k / rate_hz, fix, filter_, (0.0, 0.0),
            noise_m=noise_m, overconfidence=1.0, heading=heading,
        )  # fmt: skip
    return told.stretched, float(np.mean(within[100:]))


@pytest.mark.parametrize("of_told", [0.5, 1.0, 3.0, 10.0])
def test_spreads_of_speed_come_to_be_as_large_as_its_errors(of_told: float) -> None:
    stretched, within = driven(speed_off_mps=0.1 * of_told)
    assert 0.9 < within < 0.99
    assert stretched.speed == pytest.approx(of_told, rel=0.5)


def test_a_heading_that_is_off_is_told_so_and_one_that_is_not_is_told_better() -> None:
    assert driven(yaw_off_rad=0.08)[0].yaw == pytest.approx(4.0, rel=0.5)
    assert driven()[0].yaw < 0.7


def test_where_a_heading_is_measured_the_course_does_not_make_it_surer() -> None:
    assert driven(heading=True)[0].yaw == 1.0
    assert driven(heading=True, yaw_off_rad=0.08)[0].yaw > 2.0


def test_places_are_told_worse_and_never_better_for_what_all_fixes_err_alike_shows_nowhere() -> (
    None
):
    assert driven()[0].place == 1.0
    assert driven(place_off_m=0.3)[0].place > 3.0


@pytest.mark.parametrize("changed", [{"noise_m": None}, {"rate_hz": 1.0}, {"noise_m": 1.0}])
def test_fixes_that_cannot_show_it_change_nothing(changed: dict[str, float]) -> None:
    stretched, _ = driven(speed_off_mps=1.0, yaw_off_rad=0.2, **changed)
    assert (stretched.speed, stretched.yaw) == (1.0, 1.0)


def test_slow_cars_show_no_course_and_standing_ones_no_speed() -> None:
    slow, _ = driven(yaw_off_rad=0.5, speed_off_mps=0.5, speed_mps=1.5)
    assert slow.yaw == 1.0
    assert slow.speed > 2.0
    assert driven(speed_off_mps=0.5, speed_mps=0.2)[0].speed == 1.0


def test_a_copy_goes_on_by_itself() -> None:
    told = ToldSpreads()
    other = told.copy()
    filter_ = KinematicFilter(xy_m=np.zeros(2), yaw_rad=0.0, speed_mps=9.0, yaw_std_rad=0.02)
    for k in range(40):
        other.take(
            0.2 * k, np.array([2.0 * k, 0.0]), filter_, (0.0, 0.0),
            noise_m=0.01, overconfidence=1.0, heading=False,
        )  # fmt: skip
    assert other.stretched != told.stretched == Stretched(1.0, 1.0, 1.0)
