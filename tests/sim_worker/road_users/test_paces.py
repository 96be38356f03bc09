"""Motions along paths: bounded across and along, and the same by time and by place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.road_users.paces import Paces, briskness


def hook(radius_m: float, turn_rad: float) -> FrenetPath:
    """Return 80 m of straight, an arc, and 80 m of straight."""
    angle = np.linspace(0.0, turn_rad, 60)[1:]
    arc = radius_m * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    away = np.array([math.cos(turn_rad), math.sin(turn_rad)])
    before = np.stack([np.arange(-80.0, 0.5), np.zeros(81)], axis=1)
    return FrenetPath(np.concatenate([before, arc, arc[-1] + np.arange(1.0, 81.0)[:, None] * away]))


HOOK, STRAIGHT = hook(4.0, math.radians(100.0)).eased, hook(50.0, 0.0)


def alone(path: FrenetPath, speed_mps: float, brisk: float = 1.0) -> Paces:
    return Paces([path], np.zeros(1, np.intp), np.array([speed_mps]), np.array([brisk]))


def driven(paces: Paces, path: FrenetPath, *, tick_s: float = 0.05) -> tuple[Array, Array, Array]:
    """Return accelerations along, across, and of the places themselves, all the way."""
    time = float(paces.time_at(0, np.array(1.0))) + np.arange(0.0, 350.0, tick_s)
    at = paces.at(0, time)
    on_way = at.arc_m < path.length_m - 5.0
    arc, speed = at.arc_m[on_way], at.speed_mps[on_way]
    pose = path.pose_at(arc)
    across = np.diff(pose.yaw_rad) / tick_s * (speed[1:] + speed[:-1]) / 2.0
    places = (pose.xy_m[8:] - 2.0 * pose.xy_m[4:-4] + pose.xy_m[:-8]) / (4.0 * tick_s) ** 2
    return np.diff(speed) / tick_s, across, np.hypot(*places.T)


def test_round_a_hook_of_4_m_nobody_is_thrown_off() -> None:
    """At 49 km/h all the way it would be 46 m/s² across."""
    along, across, places = driven(alone(HOOK, 13.6), HOOK)
    assert np.abs(across).max() == pytest.approx(driver.LATERAL_ACCEL_MPS2, rel=0.05)
    assert along.min() == pytest.approx(-driver.COMFORT_DECEL_MPS2, rel=0.05)
    assert along.max() == pytest.approx(driver.MAX_ACCEL_MPS2, rel=0.05)
    assert places.max() < 1.6 * driver.LATERAL_ACCEL_MPS2


@given(
    radius=st.floats(2.0, 60.0),
    turn=st.floats(-2.9, 2.9),
    speed=st.floats(0.5, 40.0),
    brisk=st.floats(0.5, 2.0),
)
def test_no_bend_asks_for_more_than_a_driver_gives(
    radius: float, turn: float, speed: float, brisk: float
) -> None:
    path = hook(radius, turn).eased
    along, across, _ = driven(alone(path, speed, brisk), path)
    assert np.abs(across).max() <= 1.02 * brisk * driver.LATERAL_ACCEL_MPS2
    assert along.min() >= -1.02 * brisk * driver.COMFORT_DECEL_MPS2
    assert along.max() <= 1.02 * brisk * driver.MAX_ACCEL_MPS2


def test_beyond_the_end_of_a_path_the_last_speed_is_kept() -> None:
    """Behind the hook nobody has 60 m/s before the nodes of the path are over."""
    paces = alone(HOOK, 60.0)
    end = paces.time_at(0, np.array(HOOK.arc_m[-1]))
    before, at_end, later = (paces.at(0, end + late_s) for late_s in (-0.2, 0.0, 4.0))
    assert at_end.speed_mps > before.speed_mps + 0.1
    assert later.speed_mps == pytest.approx(at_end.speed_mps, abs=1e-6)
    assert later.arc_m - at_end.arc_m == pytest.approx(4.0 * at_end.speed_mps, rel=1e-6)


@given(arc=st.floats(-200.0, 400.0), speed=st.floats(0.2, 40.0))
def test_when_somebody_is_somewhere_it_is_there(arc: float, speed: float) -> None:
    paces = Paces([STRAIGHT, HOOK], np.array([1, 0, 1]), np.array([9.0, 5.0, speed]), np.ones(3))
    time = paces.time_at(np.array([2, 2]), np.array([arc, arc + 0.01]))
    at = paces.at(np.array([2, 2]), time)
    assert at.arc_m == pytest.approx([arc, arc + 0.01], abs=1e-5)
    assert at.speed_mps.max() <= speed + 1e-9
    assert np.diff(time)[0] == pytest.approx(0.02 / at.speed_mps.sum(), rel=1e-2)


def test_on_a_straight_the_speed_is_kept() -> None:
    paces = alone(STRAIGHT, 11.0)
    begin = paces.time_at(0, np.array(10.0))
    assert paces.at(0, begin + 3.0).arc_m == pytest.approx(43.0)


def test_who_brakes_does_so_from_the_speed_that_it_has() -> None:
    """10 m, then v² / (2 a) = 12.5 m."""
    paces = alone(STRAIGHT, 10.0)
    begin = paces.time_at(0, np.array(5.0))
    at = paces.braked(0, begin + np.array([1.0, 2.0, 9.0]), begin + 1.0, 4.0)
    assert at.arc_m == pytest.approx([15.0, 23.0, 27.5])
    assert at.speed_mps == pytest.approx([10.0, 6.0, 0.0])


def test_who_stops_gently_never_needs_its_brakes_harder_before_a_bend() -> None:
    brisk = briskness("stops", 2.0)
    along, _, _ = driven(alone(HOOK, 13.6, brisk), HOOK)
    assert along.min() >= -2.0 - 0.02
    assert briskness("heedless", 2.0) == briskness("stops", 6.0) == driver.HEEDLESS_BRISKNESS


def test_who_brakes_by_nothing_keeps_its_speed() -> None:
    paces = alone(STRAIGHT, 12.0)
    begin = paces.time_at(0, np.array(0.0))
    at = paces.braked(0, begin + np.array([1.0, 9.0]), begin + 1.0, np.array([0.0, 0.0]))
    np.testing.assert_allclose(at.arc_m, [12.0, 108.0])
    np.testing.assert_allclose(at.speed_mps, 12.0)
