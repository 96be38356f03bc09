"""The planned touch of two boxes, on roads that cross at any angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import RoadUserKind
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.rectangles import Rectangles, clearance, overlapping
from foretwin.sim_worker.scenarios.impact import (
    Impact,
    MovingBox,
    ego_box,
    find_impact,
    first_touch,
    front_point,
)
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

REACH = (60.0, 140.0)


def straight(angle_rad: float) -> FrenetPath:
    """Return a path of 200 m that passes the origin at 100 m."""
    direction = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    return FrenetPath(np.array([[-100.0], [100.0]]) * direction)


def car(speed_mps: float) -> MovingBox:
    """Return the ego, which drives east."""
    return ego_box(load_vehicle(), straight(0.0), speed_mps)


BOX = car(0.0)


def other(path: FrenetPath, speed_mps: float, kind: RoadUserKind = "car") -> MovingBox:
    return MovingBox(path, speed_mps, KINDS[kind].length_m, KINDS[kind].width_m)


def plan(ego: MovingBox, actor: MovingBox, share: float) -> Impact | None:
    return find_impact(
        ego, actor, ego_span=REACH, actor_span=REACH, share=share, near_sign=1.0, lead_time_s=4.0
    )


def test_a_square_crossing_is_met_by_the_middle_of_the_front() -> None:
    """At 90° the front of length f reaches the other's near flank at -width / 2."""
    found = plan(car(8.0), other(straight(math.pi / 2), 10.0), 0.5)
    assert found is not None
    assert found.ego_arc_m == pytest.approx(100.0 - BOX.front_m - 1.8 / 2, abs=1e-6)
    assert found.point_m == pytest.approx([-0.9, 0.0], abs=1e-6)
    assert found.actor_arc_m == pytest.approx(100.0 - 4.5 / 4, abs=1e-6)


def test_shares_count_from_the_near_side() -> None:
    walker = other(straight(math.pi / 2), 1.4, "pedestrian")
    near, across = (plan(car(8.0), walker, share) for share in (0.0, 1.0))
    assert near is not None
    assert across is not None
    # Traffic keeps right: the near side is the right one.
    assert near.point_m[1] == pytest.approx(-BOX.width_m / 2, abs=1e-6)
    assert across.point_m[1] == pytest.approx(BOX.width_m / 2, abs=1e-6)


@given(
    angle_deg=st.floats(25.0, 335.0),
    ego_speed=st.floats(2.0, 20.0),
    speed=st.floats(1.0, 20.0),
    share=st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]),
    kind=st.sampled_from(["car", "pedestrian", "bicycle", "van", "bus"]),
)
def test_what_is_found_is_the_first_touch_and_where_it_was_planned(
    angle_deg: float, ego_speed: float, speed: float, share: float, kind: RoadUserKind
) -> None:
    ego, actor = car(ego_speed), other(straight(math.radians(angle_deg)), speed, kind)
    found = plan(ego, actor, share)
    if found is None:
        return
    time = np.arange(-4.0, 0.05, 0.001)
    front = ego.rectangles(found.ego_arc_m + ego_speed * time)
    hit = overlapping(front, actor.rectangles(found.actor_arc_m + speed * time))
    first = float(time[hit.argmax()])
    assert hit.any()
    met = front_point(ego, np.array([found.ego_arc_m + ego_speed * first]), share, 1.0)
    assert float(np.hypot(*(met[0] - found.point_m))) <= 0.1
    box = actor.rectangles(np.array([found.actor_arc_m + speed * first]))
    assert float(clearance(Rectangles(met, np.zeros(1), 1e-6, 1e-6), box)[0]) <= 0.1


@pytest.mark.parametrize("angle_deg", [60.0, 80.0, 90.0, 100.0, 120.0, 150.0, 180.0, 210.0, 270.0])
def test_some_share_of_the_front_can_be_met_at_every_angle(angle_deg: float) -> None:
    actor = other(straight(math.radians(angle_deg)), 8.0)
    assert any(plan(car(8.0), actor, share) for share in (0.5, 0.25, 0.75, 0.0, 1.0))


def test_who_drives_beside_is_never_met() -> None:
    lane = FrenetPath(np.array([[-100.0, 4.0], [100.0, 4.0]]))
    assert plan(car(8.0), other(lane, 8.0), 0.5) is None


def test_a_braking_lead_is_touched_when_the_gap_is_used_up() -> None:
    """10 m/s, braking after 1 s with 2 m/s²: the gap of 16 m closes when t² = 16, t = 4 s on."""
    lead = other(straight(0.0), 10.0)._replace(brakes_after_s=1.0, decel_mps2=2.0)
    start = 20.0 + BOX.front_m + 16.0 + KINDS["car"].length_m / 2
    touch = first_touch(car(10.0), lead, 20.0, start, until_s=8.0)
    assert touch.time_s[0] == pytest.approx(5.0, abs=1e-3)


def test_in_reverse_the_rear_leads() -> None:
    vehicle = load_vehicle()
    box = ego_box(vehicle, straight(0.0), 1.0, reverse=True)
    assert box.front_m == vehicle.rear_overhang_m.value
    at = box.rectangles(np.array([100.0]))
    # Driving east backwards, the bumper is a rear overhang east of the axle, the nose far west.
    assert at.centre_m[0, 0] + box.length_m / 2 == pytest.approx(vehicle.rear_overhang_m.value)
