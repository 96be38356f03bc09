"""Driving what the real car planned, and driving backwards."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.planner_interface import KnownPlan
from foretwin.sim_worker.planners.as_planned import AsPlanned
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.planners.reverse_pursuit import ReversePursuit
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.planners.driven import Other, at_rest_on, drive, straight, view_of, walker

COVERS = (
    "foretwin.sim_worker.planners.as_planned",
    "foretwin.sim_worker.planners.reverse_pursuit",
    "foretwin.sim_worker.planners.trajectory_tracking",
)

VEHICLE = load_vehicle()


def plan_along(path: FrenetPath, speed: Array, *, step_s: float = 0.1) -> KnownPlan:
    """Speeds at even instants along a path, from its beginning."""
    arc = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step_s)])
    pose = path.pose_at(arc)
    return KnownPlan(step_s * np.arange(len(speed)), pose.xy_m, pose.yaw_rad, speed)


def bend(radius_m: float = 15.0) -> FrenetPath:
    angle = np.linspace(0.0, math.pi / 2, 40)
    turn = radius_m * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    return FrenetPath(np.concatenate([[[-20.0, 0.0]], turn, turn[-1:] + np.array([0.0, 80.0])]))


def test_the_plan_is_driven_in_time_and_space() -> None:
    path = bend()
    speed = np.concatenate([np.linspace(8.0, 5.0, 21), np.full(20, 5.0), np.linspace(5.0, 9.0, 21)])
    plan = plan_along(path, speed)
    done = drive(
        AsPlanned(), path, at_rest_on(path, 0.0, 8.0), vehicle=VEHICLE, seconds=6.0, car_plan=plan
    )
    wanted = np.stack([np.interp(done.time_s, plan.time_s, plan.xy_m[:, k]) for k in (0, 1)], -1)
    away = np.hypot(*(done.states[0, :, :2] - wanted).T)
    assert away.max() < 0.6
    assert np.sqrt(np.mean(away**2)) < 0.35


def test_a_car_that_starts_elsewhere_catches_up_with_the_plan() -> None:
    path = straight()
    plan = plan_along(path, np.full(91, 8.0))
    starts = at_rest_on(path, 0.0, 8.0, count=3)
    starts[:, 0] = -3.0, 0.0, 3.0
    starts[:, 1] = 0.5, -1.0, 0.0
    starts[1, 3] = 5.0
    done = drive(AsPlanned(), path, starts, vehicle=VEHICLE, seconds=9.0, car_plan=plan)
    assert done.states[:, -1, 0] == pytest.approx(72.0, abs=0.3)
    assert done.states[:, -1, 1] == pytest.approx(0.0, abs=0.1)


def test_a_planned_stop_is_held() -> None:
    path = straight()
    speed = np.concatenate([np.linspace(8.0, 0.0, 41), np.zeros(40)])
    plan = plan_along(path, speed)
    done = drive(
        AsPlanned(), path, at_rest_on(path, 0.0, 8.0), vehicle=VEHICLE, seconds=7.9, car_plan=plan
    )
    assert done.states[0, -1, 0] == pytest.approx(16.0, abs=0.4)
    assert np.abs(done.states[0, -20:, 3]).max() < 0.02


def test_past_its_end_it_drives_on_as_the_plain_driver_does() -> None:
    path = straight()
    plan = plan_along(path, np.full(11, 8.0))
    states = at_rest_on(path, 30.0, 6.0, count=2)
    view = view_of(path, states, VEHICLE, time_s=1.05, car_plan=plan)
    mine, plain = AsPlanned().plan(view), PurePursuitIdm().plan(view)
    assert mine.accel_mps2.tobytes() == plain.accel_mps2.tobytes()
    assert mine.tire_angle_rad.tobytes() == plain.tire_angle_rad.tobytes()


def test_without_a_plan_it_says_so() -> None:
    view = view_of(straight(), at_rest_on(straight(), 0.0), VEHICLE)
    with pytest.raises(ValueError, match="the car has sent no plan to drive"):
        AsPlanned().plan(view)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda p: p._replace(time_s=p.time_s[::-1].copy()), "time_s does not rise"),
        (lambda p: p._replace(speed_mps=p.speed_mps * np.nan), "speed_mps holds what is no number"),
        (lambda p: p._replace(xy_m=p.xy_m[:3]), "xy_m of shape"),
        (lambda p: KnownPlan(*(v[:1] for v in p)), "two or more instants"),
    ],
)
def test_a_plan_that_is_none_is_named(spoil: object, words: str) -> None:
    plan = spoil(plan_along(straight(), np.full(11, 8.0)))  # type: ignore[operator]
    view = view_of(straight(), at_rest_on(straight(), 0.0), VEHICLE, car_plan=plan)
    with pytest.raises(ValueError, match=words):
        AsPlanned().plan(view)


def bay_path() -> FrenetPath:
    """Straight on to the west, then by two arcs of 6 m to the side, as into a bay beside a road."""
    angle = np.linspace(0.0, math.acos(1.0 - 2.5 / 12.0), 12)
    along, aside = 6.0 * np.sin(angle), 6.0 * (1.0 - np.cos(angle))
    x = np.concatenate([[0.0, 12.0], 12.0 + along, 12.0 + 2 * along[-1] - along[-2::-1]])
    y = np.concatenate([[0.0, 0.0], aside, 2.5 - aside[-2::-1]])
    return FrenetPath(np.column_stack([-x, y]))


def backing(path: FrenetPath, arc_m: float) -> Array:
    starts = at_rest_on(path, arc_m)
    starts[:, 2] += math.pi
    return starts


@pytest.mark.parametrize("speed", [1.1, 2.2])
def test_it_backs_into_a_bay_and_stops_at_its_end(speed: float) -> None:
    path = bay_path()
    done = drive(
        ReversePursuit(), path, backing(path, 2.0), vehicle=VEHICLE, seconds=30.0,
        target_mps=speed,
    )  # fmt: skip
    assert done.states[0, :, 3].min() == pytest.approx(-speed, abs=0.2)
    assert np.abs(done.offset_m).max() < 0.25
    assert done.arc_m[0, -1] == pytest.approx(path.length_m, abs=0.3)
    assert abs(done.states[0, -1, 3]) < 0.02
    turned = done.states[0, -1, 2] - done.states[0, 0, 2]
    assert turned == pytest.approx(0.0, abs=math.radians(8.0))


def test_it_stops_for_who_walks_or_stands_behind_it() -> None:
    path = FrenetPath(np.array([[0.0, 0.0], [-60.0, 0.0]]))
    crossing = walker(np.array([[-14.0, -40.0], [-14.0, 40.0]]), 1.2, 40.0 - 1.2 * 8.0)
    wall = Other(np.array([[-30.0, 0.0], [-31.0, 0.0]]), 0.0, 0.0)
    done = drive(
        ReversePursuit(), path, backing(path, 2.0), vehicle=VEHICLE, seconds=40.0,
        target_mps=1.5, others=[crossing, wall],
    )  # fmt: skip
    assert done.clearance_m.min() > 0.1
    rear = done.states[0, -1, 0] - VEHICLE.rear_overhang_m.value
    assert -30.0 + 2.25 < rear < -30.0 + 2.25 + 1.5
