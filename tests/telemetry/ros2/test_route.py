"""A LaneletRoute becomes start and goal on Earth, said again each second; the rest is counted."""

from __future__ import annotations

import math

import pytest

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import RouteToGoal
from foretwin.contracts.frames import local_from_geo
from foretwin.telemetry.ros2.gateway import Gateway
from foretwin.telemetry.ros2.mapping import parse_mapping
from foretwin.telemetry.ros_messages.parts import (
    LANELET_ROUTE,
    header_from,
    pose_from,
    ros_message,
)
from tests.contracts.memory_bus import MemoryBus
from tests.telemetry.ros2.gateway_ground import FRAME, RecordingForeign, cdr

COVERS = ("foretwin.telemetry.ros2.inwards",)

S = 10**9
KEY = "0/planning/route/autoware_planning_msgs::msg::dds_::LaneletRoute_/RIHS01_x"
MAP = """[map]
lat_deg = 52.5
lon_deg = 13.4
"""
TEXT = """dialect = "rmw_zenoh"
{map}
[[in]]
topic = "/planning/route"
type = "autoware_planning_msgs/msg/LaneletRoute"
channel = "route"
"""


def lanelet_route(*, frame: str = "map", goal_x_m: float = 900.0) -> bytes:
    return cdr(
        LANELET_ROUTE,
        header=header_from(5 * S, frame),
        start_pose=pose_from(10.0, -5.0, 0.0, 0.5),
        goal_pose=pose_from(goal_x_m, 40.0, 0.0, -2.0),
        segments=[ros_message("autoware_planning_msgs/msg/LaneletSegment")] * 3,
    )


class Ground:
    """A gateway that hears a route."""

    def __init__(self, *, placed: bool = True) -> None:
        self.now_ns = S
        self.bus, self.foreign, self.box = MemoryBus(), RecordingForeign(), Mailbox(16)
        self.bus.subscribe("route", self.box, vehicle="ego")
        self.gateway = Gateway(
            parse_mapping(TEXT.format(map=MAP if placed else ""), name="m.toml"),
            bus=self.bus,
            foreign=self.foreign,
            run_id="r",
            vehicle_id="ego",
            drive_frame=FRAME,
            flag_on=False,
            mono_ns=lambda: self.now_ns,
            wall_ns=lambda: 10**18,
        )

    def step(self, *payloads: bytes, passed_s: float = 0.0) -> list[RouteToGoal]:
        self.now_ns += round(passed_s * S)
        for payload in payloads:
            self.foreign.arrive(KEY, payload, mono_ns=self.now_ns)
        self.gateway.step(0.0)
        heard = []
        while (item := self.box.take()) is not None:
            heard.append(item.message())
        return heard


def test_start_and_goal_are_placed_on_earth_and_lanelets_counted() -> None:
    ground = Ground()
    assert any(key.endswith("with history") for key in ground.foreign.subscribed)
    said = ground.step(lanelet_route())[0]
    assert (said.stamp_ns, said.segments) == (5 * S, 3)
    for pose, xy_m, yaw in ((said.start, (10.0, -5.0), 0.5), (said.goal, (900.0, 40.0), -2.0)):
        at = pose.position
        assert local_from_geo(FRAME, at.lat_deg, at.lon_deg) == pytest.approx(xy_m, abs=1e-6)
        assert pose.yaw_rad == pytest.approx(yaw, abs=1e-3)


def test_who_comes_later_hears_of_it_within_a_second() -> None:
    ground = Ground()
    ground.step(lanelet_route())
    assert ground.step(passed_s=0.4) == []
    assert len(ground.step(passed_s=0.7)) == 1


@pytest.mark.parametrize(
    ("placed", "frame", "goal_x_m"),
    [(False, "map", 900.0), (True, "odom", 900.0), (True, "map", math.nan)],
)
def test_a_route_that_lies_nowhere_is_counted_and_passed_over(
    placed: bool, frame: str, goal_x_m: float
) -> None:
    ground = Ground(placed=placed)
    assert ground.step(lanelet_route(frame=frame, goal_x_m=goal_x_m), passed_s=2.0) == []
    assert sum(ground.gateway.report()["unused"].values()) == 1
