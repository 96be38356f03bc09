"""A path that begins as the car drives, and becomes the road's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.orchestrator.rounds.path_from_car import ASIDE_SHARE, led_from_car
from tests.orchestrator.house import House

EAST = np.column_stack([np.arange(-10.0, 241.0), np.zeros(251)])
HERE = 10
"""Where the car is beside the path: its point of x 0."""


def led(
    *, aside_m: float = 0.0, turned_rad: float = 0.0, speed_mps: float = 10.0, way_rad: float = 0.0
) -> np.ndarray:
    """How far left of a path towards `way_rad` its points are moved."""
    turn = np.array(
        [[math.cos(way_rad), -math.sin(way_rad)], [math.sin(way_rad), math.cos(way_rad)]]
    )
    path = EAST @ turn.T
    found = led_from_car(
        path,
        car_xy_m=np.array([0.2, aside_m]) @ turn.T,
        car_yaw_rad=way_rad + turned_rad,
        speed_mps=speed_mps,
    )
    moved = (found - path) @ turn
    np.testing.assert_allclose(moved[:, 0], 0.0, atol=1e-9)
    return moved[:, 1]


def test_a_car_that_drives_along_its_path_keeps_it() -> None:
    np.testing.assert_allclose(led(), 0.0, atol=1e-12)


@given(turned_rad=st.floats(-0.45, 0.45), way_rad=st.floats(-math.pi, math.pi))
def test_it_begins_with_the_cars_heading_and_ends_with_the_roads(
    turned_rad: float, way_rad: float
) -> None:
    moved = led(turned_rad=turned_rad, way_rad=way_rad)
    slope = np.gradient(moved)

    assert slope[HERE] == pytest.approx(math.tan(turned_rad), abs=0.02)
    assert abs(moved[HERE]) < 0.15
    assert abs(moved[-1]) < 0.1
    assert (moved[HERE + 2 :] * turned_rad >= 0.0).all()


def test_the_faster_the_car_the_later_the_roads_heading_counts() -> None:
    farthest = [int(led(turned_rad=0.1, speed_mps=v).argmax()) for v in (0.0, 5.0, 10.0, 20.0)]

    assert farthest == sorted(set(farthest))


def test_a_part_of_what_the_car_lies_aside_fades() -> None:
    moved = led(aside_m=1.5)

    np.testing.assert_allclose(moved[: HERE + 1], 0.0, atol=1e-12)
    assert (np.diff(moved[HERE + 1 :]) < 0.0).all()
    assert moved[-1] == pytest.approx(-1.5 * ASIDE_SHARE, abs=0.02)


@given(
    aside_m=st.floats(-5.0, 5.0),
    turned_rad=st.floats(-1.5, 1.5),
    speed_mps=st.floats(-2.0, 30.0),
    way_rad=st.floats(-math.pi, math.pi),
)
def test_both_lead_so_far_aside(
    aside_m: float, turned_rad: float, speed_mps: float, way_rad: float
) -> None:
    """The heading, of up to 0.5 rad, over 2.6 s and 2 m; a third of up to 3 m aside over 5 s and
    1 m, ahead of the car alone."""
    ahead_m, speed = EAST[:, 0] - 0.2, max(speed_mps, 0.0)
    tangent = math.tan(max(-0.5, min(turned_rad, 0.5)))
    heading = tangent * ahead_m * np.exp(-np.abs(ahead_m) / (2.6 * speed + 2.0))
    fades = 1.0 - np.exp(-np.maximum(ahead_m, 0.0) / (5.0 * speed + 1.0))
    wanted = heading - 0.33 * max(-3.0, min(aside_m, 3.0)) * fades

    moved = led(aside_m=aside_m, turned_rad=turned_rad, speed_mps=speed_mps, way_rad=way_rad)
    np.testing.assert_allclose(moved, wanted, atol=1e-9)


def test_on_a_way_that_comes_back_the_car_is_where_it_begins() -> None:
    """It is looked for on the first 60 m."""
    there = np.column_stack([np.arange(0.0, 80.0), np.zeros(80)])
    path = np.concatenate([there, there[::-1] + np.array([0.0, 2.0])])
    car_xy_m = np.array([58.0, 1.9])
    found = led_from_car(path, car_xy_m=car_xy_m, car_yaw_rad=0.0, speed_mps=10.0)
    assert found[58 + 15, 1] == pytest.approx(-0.33 * 1.9 * (1.0 - math.exp(-15.0 / 51.0)))


def test_a_car_that_crosses_the_road_is_not_followed_across() -> None:
    assert np.abs(led(turned_rad=3.0)).max() < 6.0
    np.testing.assert_allclose(led(turned_rad=0.6), led(turned_rad=1.4), atol=1e-12)


def test_a_car_on_another_lane_is_not_led_off_its_own() -> None:
    np.testing.assert_allclose(led(aside_m=3.5), led(aside_m=6.0), atol=1e-12)


def test_the_jobs_of_a_round_begin_as_the_car_drives(tmp_path: object) -> None:
    house = House(tmp_path, futures=2, futures_per_job=2)  # type: ignore[arg-type]
    house.drive(20)
    intent = house.mission.plan_round()
    assert house.conductor.start_round()
    house.settle()
    (request,) = house.workers[0].take() + house.workers[1].take()
    job = request.message().decoded()
    house.tables.close()

    assert job.speed_ahead_mps[0] == intent.speed_ahead_mps[0]  # type: ignore[union-attr]
    assert len(job.speed_ahead_mps) == 17
    moved = np.hypot(*(job.path.xy_m - intent.path.xy_m).T)  # type: ignore[union-attr]
    assert 0.0 < moved.max() < 1.5
