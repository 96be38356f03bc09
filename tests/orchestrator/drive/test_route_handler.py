"""The route of a live vehicle during a drive: taken, kept, found anew, or refused in one line."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import PlannedTrajectory, RouteToGoal, VehicleState
from foretwin.contracts.frames import geo_from_local
from foretwin.contracts.mailbox import Mailbox
from foretwin.orchestrator.config import ConfigError, DriveConfig
from foretwin.orchestrator.drive.ros2_mapping import read_ros2
from foretwin.orchestrator.drive.route_handler import RouteHandler
from foretwin.orchestrator.routing.route import Route
from foretwin.telemetry.ros2.mapping import AUTOWARE, MappingError
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.grid_map import FRAME
from tests.orchestrator.routing.test_route_to_goal import EAST, NORTH, TOWN, degrees, pose
from tests.orchestrator.trip import town_plan

COVERS = ("foretwin.orchestrator.drive.ros2_mapping",)

S = 10**9


class Ground:
    """A handler on the grid town, and what it hands on."""

    def __init__(self, folder: Path) -> None:
        plan = town_plan(folder)
        config = msgspec.structs.replace(plan.config, route="live", source="live")
        self.routes: list[Route] = []
        self.told: list[str] = []
        self.bus, self.box = MemoryBus(), Mailbox(8)
        self.handler = RouteHandler(
            replace(plan, graph=TOWN, config=config), use=self.routes.append,
            tell=lambda told: self.told.append(f"{told.level}: {told.text}"),
        )  # fmt: skip
        self.handler.join(self.bus, self.box)

    def say(self, said: RouteToGoal) -> None:
        self.bus.publish("route", said, vehicle="ego")
        self.handler.take(self.box.take())

    def drive(self, t_s: float, plan: PlannedTrajectory | None = None) -> None:
        self.handler.keep_up_with(state(t_s), plan)

    def settle(self, t_s: float, count: int, plan: PlannedTrajectory | None = None) -> None:
        """Drive on until so much has been told."""
        deadline = time.monotonic() + 30.0
        while len(self.told) < count:
            assert time.monotonic() < deadline
            self.drive(t_s, plan)
            threading.Event().wait(0.005)


@pytest.fixture
def ground(tmp_path: Path) -> Iterator[Ground]:
    found = Ground(tmp_path)
    yield found
    found.handler.close()


def state(t_s: float) -> VehicleState:
    at = pose(20.0, 0.0, EAST)
    return VehicleState(
        vehicle_id="ego", stamp_ns=round(t_s * S), position=at.position, yaw_rad=0.0,
        speed_mps=8.0, yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip


def plan_along(t_s: float, *points_m: tuple[float, float]) -> PlannedTrajectory:
    line = degrees(*points_m)
    count = len(line)
    return PlannedTrajectory(
        stamp_ns=round(t_s * S), time_from_stamp_s=np.arange(count, dtype=np.float64),
        lat_deg=line[:, 0], lon_deg=line[:, 1], yaw_rad=np.zeros(count), speed_mps=np.ones(count),
    )  # fmt: skip


TO_COLUMN_3 = RouteToGoal(
    stamp_ns=0, start=pose(20.0, 0.0, EAST), goal=pose(300.0, 150.0, NORTH), segments=41
)


def test_the_route_is_taken_once_however_often_it_is_said(ground: Ground) -> None:
    ground.say(TO_COLUMN_3)
    ground.settle(1.0, 1)
    for t_s in (2.0, 3.0, 4.0):
        ground.say(TO_COLUMN_3)
        ground.drive(t_s)
    (route,) = ground.routes
    assert route.edges[-1].edge.name == "Column 3"
    (told,) = ground.told
    lat, lon = geo_from_local(FRAME, np.array([300.0, 150.0])).tolist()
    assert told == (
        f"info: route of the vehicle taken: 0.5 km to {lat:.5f}, {lon:.5f}, the shortest way on "
        "this map: its 41 lanelets say nothing without their own"
    )


def test_a_plan_that_leads_elsewhere_gives_the_near_part(ground: Ground) -> None:
    ground.say(TO_COLUMN_3)
    ground.settle(1.0, 1)
    straight_on = ground.routes[0].edges[1].edge.name
    turn = [(20.0, 0.0), (100.0, 0.0), (100.0, 60.0)]
    other = [(20.0, 0.0), (100.0, 0.0), (160.0, 0.0)]
    away = turn if straight_on == "Row 0" else other
    ground.settle(3.0, 2, plan_along(3.0, *away))
    assert "follows its plan" in ground.told[1]
    assert "the first 200 m as it plans" in ground.told[1]
    assert ground.routes[1].edges[1].edge.name != straight_on
    # A plan on the new route changes nothing.
    ground.drive(5.0, plan_along(5.0, *away))
    ground.drive(7.0, plan_along(7.0, *away))
    assert len(ground.routes) == 2


def test_another_goal_makes_another_route(ground: Ground) -> None:
    ground.say(TO_COLUMN_3)
    ground.settle(1.0, 1)
    ground.say(msgspec.structs.replace(TO_COLUMN_3, goal=pose(250.0, 0.0, EAST)))
    ground.settle(2.0, 2)
    assert ground.routes[-1].end_m == pytest.approx(300.0)


def test_a_goal_that_cannot_be_matched_is_told_once_and_the_way_is_predicted(
    ground: Ground,
) -> None:
    nowhere = msgspec.structs.replace(TO_COLUMN_3, goal=pose(50.0, 50.0, EAST))
    ground.say(nowhere)
    ground.settle(1.0, 1)
    for t_s in (3.0, 5.0):
        ground.say(nowhere)
        ground.drive(t_s, plan_along(t_s, (20.0, 0.0), (90.0, 0.0)))
    assert ground.routes == []
    (told,) = ground.told
    assert told.startswith("warning: the vehicle's route cannot be used: its goal ")
    assert told.endswith("lies within 30 m of no road; the way ahead is predicted")


def test_a_route_from_the_car_needs_a_car_and_a_mapping_that_hear_of_it(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--route live needs --source live"):
        DriveConfig(map="m", route="live").validate()
    config = DriveConfig(map="m", route="live", source="live", ros2="autoware").validate()
    with pytest.raises(MappingError, match=r"--route live needs \[map\] lat_deg, lon_deg"):
        read_ros2(config)
    file = tmp_path / "m.toml"
    file.write_text(AUTOWARE.read_text().replace("# [map]\n# ", "[map]\n").replace("# lon", "lon"))
    with_route = msgspec.structs.replace(config, ros2=str(file))
    with pytest.raises(MappingError, match="endpoint must be named, that of the car's router"):
        read_ros2(with_route)  # nothing of a car could come
    assert read_ros2(msgspec.structs.replace(with_route, insecure=True)) is not None
    file.write_text('dialect = "ros2dds"\n')
    with pytest.raises(MappingError, match=r"needs an \[\[in\]\] of type autoware_planning_msgs"):
        read_ros2(msgspec.structs.replace(config, ros2=str(file)))
