"""A car driven by hand: its model at the measured steering, against its gyro."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from foretwin.sim_worker.analysis.gap.clock_offsets import (
    ClockOffset,
    apart_from_commands,
    on_one_clock,
)
from foretwin.sim_worker.analysis.gap.measured_turning import NotHeld, TurningGap
from tests.sim_worker.analysis.gap.measured_figures import Lateness, hand_driven, turning_of
from tests.sim_worker.faulty_standin import model_with

COVERS = (
    "foretwin.sim_worker.analysis.gap.clock_offsets",
    "foretwin.sim_worker.analysis.gap.turning_priors",
)

SEED = 300
LATE = Lateness(steering_s=0.13, speed_s=0.21, gyro_s=0.04, bias_radps=0.02, position_s=0.3)


@pytest.fixture(scope="module")
def gap() -> TurningGap:
    found = turning_of(hand_driven(SEED, LATE))
    assert isinstance(found, TurningGap)
    return found


def test_clocks_are_put_together(gap: TurningGap) -> None:
    """Two sensors late by other times, and a gyro that is late itself."""
    assert gap.steering_clock.late_s == pytest.approx(LATE.steering_s - LATE.gyro_s, abs=0.01)
    assert 1.96 * gap.steering_clock.std_s < 0.02
    assert gap.speed_clock is not None
    # The body pitches when it is braked, which the unit takes for acceleration, later.
    assert gap.speed_clock.late_s == pytest.approx(LATE.speed_s - LATE.gyro_s, abs=0.04)
    assert gap.position_clock is not None
    assert gap.position_clock.late_s == pytest.approx(LATE.position_s - LATE.gyro_s, abs=0.05)
    assert gap.position_clock.std_s > gap.speed_clock.std_s
    assert 0.002 < gap.response_std_s < 0.03


def test_bias_and_zero_of_the_steering_are_found(gap: TurningGap) -> None:
    # The stand-in's own gyro is off by 0.002 rad/s, and its tyres by 0.2°.
    assert gap.gyro_bias_radps == pytest.approx(LATE.bias_radps + 0.002, abs=0.002)
    assert math.degrees(gap.steering_offset_rad) == pytest.approx(0.2, abs=0.1)
    assert gap.gain == pytest.approx(16.0 / 15.3, abs=0.02)
    assert gap.departure == ""


def test_each_second_is_within_the_interval_that_the_others_say(gap: TurningGap) -> None:
    assert 0.90 <= gap.within <= 1.0
    assert math.degrees(gap.full_width_radps) < 1.0
    assert len(gap.stamp_ns) == len(gap.error_radps) == len(gap.half_width_radps) >= 30
    assert np.sqrt(np.mean(gap.error_radps**2)) < np.sqrt(np.mean(gap.file_error_radps**2))


def test_a_model_that_turns_otherwise_is_told_and_nobody_named() -> None:
    found = turning_of(hand_driven(SEED, LATE), model_with("steering_ratio"))
    assert isinstance(found, TurningGap)
    assert found.gain != pytest.approx(1.0, abs=0.2)
    assert "times as the model does at the measured steering" in found.departure
    assert "or the car's steering sensor" in found.departure


@pytest.mark.parametrize("channel", ["steering", "speed", "imu"])
def test_without_steering_speed_or_gyro_there_is_nothing_to_compare(channel: str) -> None:
    samples = [one for one in hand_driven(SEED, Lateness()) if one[0] != channel]
    assert turning_of(samples) == NotHeld("steering, speed and gyro were not all measured")


def test_samples_are_put_on_one_clock_where_it_is_told_well_enough() -> None:
    samples = hand_driven(SEED, LATE, end_s=5.0)
    clocks = {"steering": ClockOffset(0.1, 0.01), "speed": ClockOffset(0.1, 0.1), "imu": None}
    moved = on_one_clock(samples, clocks)
    stamps = [message.stamp_ns for _, message in moved]
    assert stamps == sorted(stamps)

    def of(channel: str, kept: list[tuple[str, Any]]) -> list[int]:
        return [message.stamp_ns for name, message in kept if name == channel]

    assert of("steering", moved) == [ns - 100_000_000 for ns in of("steering", samples)]
    for channel in ("speed", "imu"):
        assert of(channel, moved) == of(channel, samples)


def test_of_a_commanded_car_what_is_far_off_is_moved() -> None:
    """Steering that alone is apart from the gyro may be how the model turns."""
    sure = ClockOffset(0.0, 0.01)
    none = apart_from_commands(sure._replace(late_s=0.3), speed=sure, gnss=sure)
    assert none == {}
    near, far, doubtful = (ClockOffset(*one) for one in ((0.11, 0.01), (0.13, 0.01), (0.5, 0.25)))
    assert apart_from_commands(sure, speed=near, gnss=far) == {"gnss": far}
    assert apart_from_commands(sure, speed=far, gnss=doubtful) == {"speed": far}
    assert apart_from_commands(sure, speed=None, gnss=None) == {}


def test_where_steering_and_speed_agree_the_inertial_unit_is_late() -> None:
    early = ClockOffset(-0.3, 0.01)
    gnss = ClockOffset(0.1, 0.02)
    moved = apart_from_commands(early, speed=early._replace(late_s=-0.28), gnss=gnss)
    assert moved == {
        "imu": ClockOffset(0.28, 0.01), "gnss": ClockOffset(pytest.approx(0.38), 0.02),
    }  # fmt: skip


def test_half_a_minute_is_needed() -> None:
    short = turning_of(hand_driven(SEED, Lateness(), end_s=25.0))
    assert isinstance(short, NotHeld)
    assert re.search(r"known together for (1\d|2[0-5]) s alone, which is too short", short.why)


def test_a_sensor_later_than_is_tried_is_not_told_to_be_as_late_as_that() -> None:
    found = turning_of(hand_driven(SEED, Lateness(speed_s=1.6)))
    assert isinstance(found, TurningGap)
    assert found.speed_clock is None
    late = turning_of(hand_driven(SEED, Lateness(steering_s=1.6)))
    assert isinstance(late, NotHeld)
    assert "how late the steering is stamped cannot be told" in late.why
