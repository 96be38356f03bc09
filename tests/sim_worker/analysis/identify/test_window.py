"""A minute of the stand-in car tells what it is; a straight minute tells nothing."""

from __future__ import annotations

import functools
import time

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.tuning import Identification
from foretwin.sim_worker.analysis.identify.road_grade import grade_from_altitude
from foretwin.sim_worker.analysis.identify.steering import fit_steering
from foretwin.sim_worker.analysis.identify.steering_signals import Theta
from foretwin.sim_worker.analysis.identify.window import UNDERSTEER_NAME, identify
from foretwin.sim_worker.analysis.motion_record import MotionRecord
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.standin.parameters import read_parameters
from tests.sim_worker.analysis.identify.coverage import random_path
from tests.sim_worker.standin_drives import (
    MINUTE_S,
    city_minute,
    driven,
    estimate,
    recorded,
    straight_minute,
)

COVERS = (
    "foretwin.sim_worker.analysis.identify.actuator",
    "foretwin.sim_worker.analysis.identify.longitudinal",
    "foretwin.sim_worker.analysis.identify.steering_signals",
)

CAR = read_parameters().car
TOLD = (
    ("steering_ratio", CAR.steering_ratio, 0.02 * CAR.steering_ratio),
    ("steering_offset_rad", CAR.steering_offset_rad, np.radians(0.2)),
    ("steering_delay_s", CAR.steering_delay_s, 0.010),
    ("steering_lag_s", 1.0 / CAR.steering_gain_ps, 0.010),
    (UNDERSTEER_NAME, 0.0, 0.0003),
    ("drive_gain", CAR.drive_gain, 0.03 * CAR.drive_gain),
    ("brake_gain", CAR.brake_gain, 0.03 * CAR.brake_gain),
    ("accel_delay_s", CAR.drive_delay_s, 0.010),
    ("drag_npv2", CAR.drag_npv2, 0.2),
    ("rolling_resistance_n", CAR.rolling_resistance_n, 30.0),
)


@functools.cache
def city() -> Identification:
    return identify(city_minute(), load_vehicle(), vehicle_id="standin")


@pytest.mark.parametrize(("name", "truth", "within"), TOLD)
def test_a_minute_of_city_driving_tells_the_hidden_car(
    name: str, truth: float, within: float
) -> None:
    found = estimate(city(), name)
    assert found.reason == ""
    assert found.value is not None
    assert found.low is not None
    assert found.high is not None
    assert found.value == pytest.approx(truth, abs=within)
    assert found.low < found.value < found.high
    assert found.high - found.low < 6.0 * within


def test_intervals_hold_a_good_part_of_how_the_two_wheels_are_steered() -> None:
    record, vehicle = city_minute(), load_vehicle()
    one = fit_steering(record, vehicle)
    values, signals = one.fit.values, one.signals
    tyre = values[Theta.INVERSE_RATIO] * record.wheel_rad + values[Theta.OFFSET]
    # Of wheels that are steered alike, what turns the car is so much less.
    less = record.wheel_rad * (1.0 - 0.24 * np.square(tyre))
    alike = fit_steering(record._replace(wheel_rad=less), vehicle)

    apart = alike.signals.unexplained(values).yaw_rate_radps
    apart -= signals.unexplained(values).yaw_rate_radps
    told = signals.less_if_alike(values)
    assert float(np.abs(told).max()) == pytest.approx(0.0054, abs=0.0003)
    np.testing.assert_allclose(told, apart, atol=0.0003)
    for index in (Theta.INVERSE_RATIO, Theta.UNDERSTEER):
        moved = abs(alike.fit.values[index] - values[index])
        assert 0.55 * moved < one.half_widths[index] < 1.2 * moved


def test_a_gyro_of_the_other_sign_tells_nothing_of_the_steering() -> None:
    record = city_minute()
    mirrored = record._replace(yaw_rate_radps=-record.yaw_rate_radps)
    told = identify(mirrored, load_vehicle(), vehicle_id="standin")
    assert "steering_ratio -15." in estimate(told, "steering_ratio").reason
    for name in ("steering_offset_rad", UNDERSTEER_NAME):
        assert "steering_ratio, which is wrong" in estimate(told, name).reason
    assert estimate(told, "drive_gain").reason == ""


def test_tyres_that_scrub_near_full_lock_are_not_taken_for_drag_and_gains() -> None:
    parameters = read_parameters()
    path = random_path(np.random.default_rng(2), parameters, radii_m=(5.0, 7.0))
    drive = driven(path, parameters, seed=2, end_s=MINUTE_S)
    told = identify(recorded(drive.samples), load_vehicle(), vehicle_id="standin")
    for name, truth in (("drive_gain", CAR.drive_gain), ("brake_gain", CAR.brake_gain)):
        found = estimate(told, name)
        assert found.reason == ""
        assert found.value == pytest.approx(truth, rel=0.03), name
    assert estimate(told, "drag_npv2").value == pytest.approx(CAR.drag_npv2, abs=0.2)


def test_a_stretch_that_begins_in_motion_or_with_gaps_tells_as_much() -> None:
    whole = city_minute()
    moving = np.flatnonzero(whole.speed_mps > 5.0)[0]
    in_motion = MotionRecord._make(column[moving:] for column in whole)
    silent = (np.arange(len(whole.time_s)) % 1500) // 30 == 40
    with_gaps = whole._replace(
        command_accel_mps2=np.where(silent, np.nan, whole.command_accel_mps2),
        command_wheel_rad=np.where(silent, np.nan, whole.command_wheel_rad),
    )
    for record in (in_motion, with_gaps):
        told = identify(record, load_vehicle(), vehicle_id="standin")
        for name in ("steering_delay_s", "drive_gain", "brake_gain", "accel_delay_s"):
            found, best = estimate(told, name), estimate(city(), name)
            assert found.value == pytest.approx(best.value, rel=0.1), name


def test_the_wheelbase_is_not_told_without_a_tyre_angle() -> None:
    found = estimate(city(), "wheelbase_m")
    assert found.value is None
    assert "over steering ratio alone" in found.reason


def test_the_wheelbase_is_told_where_the_tyre_angle_is_measured() -> None:
    record = city_minute()
    tyre = record.wheel_rad / CAR.steering_ratio + CAR.steering_offset_rad
    told = identify(record._replace(tire_rad=tyre), load_vehicle(), vehicle_id="standin")
    assert estimate(told, "wheelbase_m").value == pytest.approx(2.5789, rel=0.01)


def test_the_map_says_the_ratio_where_bends_are_many_enough() -> None:
    """A minute has five bends at 5 to 8 m/s, one below and two above."""
    (entry,) = city().steering_map
    assert (entry.from_mps, entry.to_mps) == (5.0, 8.0)
    assert entry.ratio == pytest.approx(CAR.steering_ratio, rel=0.02)
    assert entry.low < CAR.steering_ratio < entry.high


def test_a_straight_motorway_changes_nothing() -> None:
    told = identify(straight_minute(), load_vehicle(), vehicle_id="standin")
    taken = [found.name for found in told.estimates if found.value is not None and not found.reason]
    assert taken == []
    assert "nearly straight" in estimate(told, "steering_ratio").reason
    assert "braked for 0.0 s" in estimate(told, "brake_gain").reason


def test_without_grade_gains_and_drag_are_not_told() -> None:
    record = city_minute()
    told = identify(
        record._replace(altitude_m=np.zeros(len(record.stamp_ns))),
        load_vehicle(),
        vehicle_id="standin",
    )
    for name in ("drive_gain", "brake_gain", "drag_npv2"):
        found = estimate(told, name)
        assert found.value is None
        assert "grade is unknown" in found.reason
    assert estimate(told, "steering_ratio").value is not None


def _nothing(record: MotionRecord) -> Array:
    return np.full(len(record.stamp_ns), np.nan)


def test_less_than_a_second_is_refused() -> None:
    record = city_minute()
    short = MotionRecord(*(column[:50] for column in record))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="less than a second"):
        identify(short, load_vehicle(), vehicle_id="standin")


def test_a_manual_drive_tells_the_steering_and_nothing_of_commands() -> None:
    record = city_minute()
    absent = _nothing(record)
    told = identify(
        record._replace(command_accel_mps2=absent, command_wheel_rad=absent),
        load_vehicle(),
        vehicle_id="standin",
    )
    assert estimate(told, "steering_ratio").value is not None
    assert estimate(told, "steering_delay_s").value is None
    assert estimate(told, "drive_gain").reason == "no acceleration was commanded"


@pytest.mark.judge
def test_one_window_takes_little_time() -> None:
    city()
    begun = time.process_time()
    for _ in range(5):
        identify(city_minute(), load_vehicle(), vehicle_id="standin")
    assert (time.process_time() - begun) / 5 <= 0.15


def test_an_even_climb_has_its_grade_from_the_first_metre_to_the_last() -> None:
    speed = np.full(len(city_minute().time_s), 20.0)
    height = 30.0 + 0.05 * 20.0 * city_minute().time_s
    climb = city_minute()._replace(speed_mps=speed, altitude_m=height)
    grade = grade_from_altitude(climb)
    assert grade == pytest.approx(0.05, rel=0.06)
    assert grade[0] == pytest.approx(0.05, rel=0.004)
