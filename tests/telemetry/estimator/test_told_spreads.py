"""What states tell of their errors comes to hold 95 of 100 of them."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import pytest

from foretwin.contracts.drive import HeadingSample
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.estimator.filter_state import CURVATURE, SPEED, X, Y
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.measured import MotionSamples
from foretwin.telemetry.estimator.motion_track import MotionTrack
from foretwin.telemetry.estimator.reported_state import moving_state
from foretwin.telemetry.estimator.told_spreads import Stretched, ToldSpreads
from tests.telemetry.position_track import FRAME, along, circle, info

COVERS = ("foretwin.telemetry.estimator.reported_state",)
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
    lever_m: tuple[float, float] = (0.0, 0.0),
    backwards: bool = False,
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
            yaw_rad=turned + backwards * math.pi + random.normal(0.0, yaw_off_rad),
            speed_mps=(speed_mps + off_mps) * (-1.0 if backwards else 1.0),
            yaw_std_rad=0.02,
        )
        filter_.covariance[SPEED, SPEED] = 0.1**2
        filter_.covariance[X, X] = filter_.covariance[Y, Y] = 0.05**2
        within.append(abs(off_mps) < 1.96 * 0.1 * told.stretched.speed)
        filter_.mean[CURVATURE] = (-1.0 if backwards else 1.0) / RADIUS_M
        at = filter_.sensor_xy(lever_m) if any(lever_m) else at
        fix = at + random.normal(0.0, noise_m or 0.0, 2)
        told.take(
            k / rate_hz, fix, filter_, lever_m,
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


@pytest.mark.parametrize("changed", [{"lever_m": (4.0, 0.0)}, {"backwards": True}])
def test_an_antenna_ahead_and_a_car_that_backs_go_as_they_face(changed: dict[str, Any]) -> None:
    assert driven(**changed)[0].yaw < 0.7


def test_states_tell_the_spreads_stretched() -> None:
    measured = MotionSamples(skipped=Counter())
    filter_ = KinematicFilter(xy_m=np.zeros(2), yaw_rad=0.0, speed_mps=9.0, yaw_std_rad=0.02)
    one, other = (
        moving_state(
            measured, "car", 0, FRAME.origin, filter_, convergence_rad=0.0,
            standing=False, map_shift_m=None, stretched=stretched,
        )
        for stretched in (Stretched(1.0, 1.0, 1.0), Stretched(2.0, 3.0, 0.5))
    )  # fmt: skip
    for name, by in (("position_std_m", 2.0), ("speed_std_mps", 3.0), ("yaw_std_rad", 0.5)):
        assert getattr(other, name) == pytest.approx(by * getattr(one, name))
        assert getattr(one, name) > 0.0


@pytest.mark.parametrize("heading", [False, True])
def test_an_estimator_narrows_what_it_tells_of_the_heading_where_none_is_measured(
    heading: bool,
) -> None:
    estimator = StateEstimator(info())
    for channel, message in along(lambda time_s: (9.0 * time_s, 0.0), 40.0):
        estimator.handle(channel, message)
        if heading:
            estimator.handle("heading", HeadingSample(stamp_ns=message.stamp_ns, yaw_rad=0.0))
    stretched = estimator.consistency.stretched
    assert (stretched.yaw == 1.0) if heading else (stretched.yaw < 0.8)


def test_a_track_that_was_copied_and_went_on_leaves_the_first_as_it_was() -> None:
    def bending(time_s: float) -> tuple[float, float]:
        return circle(time_s) if time_s < 20.0 else circle(20.0)

    samples = along(bending, 40.0)
    first, undisturbed = MotionTrack(info()), MotionTrack(info())
    for sample in samples[:60]:
        first.take(*sample)
        undisturbed.take(*sample)
    other = first.copy()
    for sample in samples[60:150]:
        other.take(*sample)
    assert first.consistency == undisturbed.consistency != other.consistency
    for sample in samples[60:]:
        first.take(*sample)
        undisturbed.take(*sample)
        assert first.state(sample[1].stamp_ns) == undisturbed.state(sample[1].stamp_ns)


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
