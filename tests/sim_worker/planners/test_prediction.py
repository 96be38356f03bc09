"""Where others are taken to be going: straight on, along the lane, braking, turning."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.planner_interface import PlannerView
from foretwin.sim_worker.planners.prediction import Changes, changes, courses
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.planners.driven import Other, at_rest_on, see, straight, view_of, walker

VEHICLE = load_vehicle()
INSTANTS_S = np.linspace(1.0 / 3.0, 4.0, 12)


def seen_from(path: FrenetPath, *others: Other, speed: float = 8.0) -> PlannerView:
    users, _ = see(path, list(others), 0.0, 1)
    return view_of(path, at_rest_on(path, 5.0, speed), VEHICLE, users=users)


def bend(radius_m: float) -> FrenetPath:
    angle = np.linspace(0.0, 2.0, 80)
    turn = radius_m * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    return FrenetPath(np.concatenate([[[-30.0, 0.0]], turn]))


def line(start: tuple[float, float], heading: float) -> Array:
    way = np.array([math.cos(heading), math.sin(heading)])
    return np.array(start) + np.array([[0.0], [200.0]]) * way


@pytest.mark.parametrize("heading", [1.2, math.pi / 2, 2.4, -1.8])
def test_who_crosses_goes_straight_on_also_where_the_path_bends(heading: float) -> None:
    path = bend(30.0)
    other = walker(line((14.0, -6.0 if heading > 0 else 18.0), heading), 2.5)
    found = courses(seen_from(path, other), INSTANTS_S, nearest=3)
    assert found is not None
    for k in (2, 5, 8, 11):
        truth = path.locate(other.at(float(INSTANTS_S[k]))[None, :2])
        assert found.arc_m[k, 0, 0] == pytest.approx(truth.arc_m[0], abs=0.9)
        assert found.offset_m[k, 0, 0] == pytest.approx(truth.offset_m[0], abs=0.9)


def test_who_drives_along_the_road_follows_its_bends() -> None:
    path = bend(30.0)
    arc, offset = 20.0, 3.5
    start = path.point_at(np.array([arc]), offset)[0]
    heading = float(path.pose_at(np.array([arc])).yaw_rad[0])
    other = Other(line((start[0], start[1]), heading), 6.0)
    found = courses(seen_from(path, other), INSTANTS_S, nearest=3)
    assert found is not None
    assert found.offset_m[:, 0, 0] == pytest.approx(3.5, abs=0.2)


def test_nobody_near_and_who_follows_are_left_out() -> None:
    path = straight()
    assert courses(view_of(path, at_rest_on(path, 5.0), VEHICLE), INSTANTS_S, nearest=3) is None
    behind = Other(line((-8.0, 0.0), 0.0), 12.0)
    far = Other(line((30.0, 25.0), 0.0), 5.0)
    leaves = Other(line((40.0, 10.0), math.pi / 2), 3.0)
    assert courses(seen_from(path, behind, far), INSTANTS_S, nearest=3) is None
    assert courses(seen_from(path, behind, far, leaves), INSTANTS_S, nearest=3) is not None


def test_who_brakes_comes_to_a_stop_and_who_turns_turns_on() -> None:
    path = straight()
    view = seen_from(path, Other(line((40.0, 3.0), math.pi), 6.0))
    assert view.users is not None
    later = view.users._replace(
        speed_mps=view.users.speed_mps - 0.2, poses=view.users.poses + np.array([0.0, 0.0, 0.02])
    )
    seen = changes(view.users, later, passed_s=0.05)
    assert seen is not None
    assert seen.brakes_mps2 == pytest.approx(4.0)
    assert seen.yaw_rate_radps == pytest.approx(0.4)

    def course(changing: Changes) -> Array:
        found = courses(view, INSTANTS_S, nearest=3, changing=changing)
        assert found is not None
        return np.column_stack([found.arc_m[:, 0, 0], found.offset_m[:, 0, 0]])

    none = np.zeros((1, 1))
    braking = course(Changes(np.full((1, 1), 4.0), none))
    assert braking[-1, 0] == pytest.approx(40.0 - 6.0**2 / 8.0, abs=1.5)
    turning = course(Changes(none, np.full((1, 1), 0.5)))
    assert turning[-1, 1] < -5.0
    either = courses(view, INSTANTS_S, nearest=3, changing=Changes(none, np.full((1, 1), 0.5)))
    assert either is not None
    assert either.offset_m[-1, 0, 1] == pytest.approx(3.0)
    assert either.half_across_m[-1, 0, 0] > 1.3 * either.half_across_m[-1, 0, 1]
    assert course(Changes(none, none))[-1] == pytest.approx([40.0 - 24.0, 3.0])
