"""Vehicles beside the car: states in its time and never later, and what futures see of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import (
    ControlCommand,
    GnssFix,
    OthersAround,
    RoadUser,
    RoadUsers,
    SpeedSample,
    VehicleInfo,
    VehicleState,
)
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.roles import OtherVehicles, Role
from foretwin.orchestrator.config import OtherVehicleConfig
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.instructions import LatestReports
from foretwin.orchestrator.other_vehicles.vehicles import OtherVehicleFeed
from foretwin.orchestrator.plan import OtherVehiclePlan
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from foretwin.telemetry.logs.write_mcap import create
from tests.contracts.memory_bus import MemoryBus
from tests.orchestrator.house import House
from tests.orchestrator.trip import START_NS, town_plan

COVERS = ("foretwin.orchestrator.other_vehicles.detected",)

VAN = load_vehicle("vw_vanagon")
INFO = VehicleInfo(vehicle_id="ego", time_base="utc", start_stamp_ns=START_NS)
ORIGIN = GeoPoint(52.5, 13.4)
FRAME = LocalFrame(ORIGIN)

ROLES: dict[str, Role] = {"ego": "all"}
ASKED: list[str] = []
TOLD: list[str] = []
AROUND: dict[str, OthersAround] = {}
"""What vehicles were told last of who is around them."""


@pytest.fixture(autouse=True)
def nothing_said() -> None:
    ASKED.clear()
    TOLD.clear()
    AROUND.clear()


def at(x_m: float, y_m: float = 0.0) -> GeoPoint:
    lat, lon = geo_from_local(FRAME, np.array([x_m, y_m]))
    return GeoPoint(float(lat), float(lon))


def own(t_s: float, x_m: float = 0.0) -> VehicleState:
    return VehicleState(
        vehicle_id="ego", stamp_ns=START_NS + round(t_s * 1e9), position=at(x_m), yaw_rad=0.0,
        speed_mps=8.0, yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip


class HearingBus(MemoryBus):
    """Keeps what is passed on, and who was asked what it is."""

    def __init__(self) -> None:
        super().__init__()
        self.heard: list[OtherVehicles] = []

    def publish(self, channel: str, message: msgspec.Struct, **ids: str) -> None:
        if isinstance(message, OthersAround):
            AROUND[ids["vehicle"]] = message
        else:
            assert isinstance(message, OtherVehicles)
            self.heard.append(message)

    def request(self, channel: str, message: msgspec.Struct, *_: object, **ids: object) -> None:
        assert channel == "info"
        ASKED.append(str(ids["vehicle"]))


def crew(at: Path, *configs: OtherVehicleConfig) -> tuple[OtherVehicleFeed, list[OtherVehicles]]:
    """The vehicles of a drive whose car begins at START_NS, and what is passed on of them."""
    members = tuple(OtherVehiclePlan(config, VAN, commands_recorded=False) for config in configs)
    plan = town_plan(at)
    lock_step = msgspec.structs.replace(plan.config, speed=None)
    plan = replace(plan, beside=members, drive_frame=FRAME, config=lock_step)
    bus = HearingBus()
    tables: Any = SimpleNamespace(add=lambda *_: None)
    context = DriveContext(plan, bus, Mailbox(8), tables, lambda told: TOLD.append(told.text))
    beside = OtherVehicleFeed(context)
    beside.begin(INFO)
    return beside, bus.heard


def van_log(folder: Path, *, start_ns: int) -> Path:
    """A log of a van that drives east at 10 m/s for 10 s, and is told so."""
    info = msgspec.structs.replace(
        INFO, vehicle_id="x", start_stamp_ns=start_ns, body_from_antenna_m=(0.0, 0.0, 0.0),
        sends=("gnss", "speed", "control"),
    )  # fmt: skip
    file = folder / "van.mcap"
    with create(file, info=info) as writer:
        for k in range(101):
            ns = start_ns + k * 100_000_000
            writer.add("gnss", GnssFix(stamp_ns=ns, position=at(k)))
            writer.add("speed", SpeedSample(stamp_ns=ns, speed_mps=10.0))
            writer.add("control", ControlCommand(stamp_ns=ns, accel_mps2=0.1, tire_angle_rad=0.0))
    return file


def drive(beside: OtherVehicleFeed, until_s: float) -> None:
    for k in range(round(until_s * 20) + 1):
        beside.keep_up_with(own(k / 20.0), None, ROLES)


def x_of(state: VehicleState) -> float:
    return float(local_from_geo(FRAME, state.position.lat_deg, state.position.lon_deg)[0])


@pytest.mark.parametrize(
    ("log_later_s", "offset_s", "at_5_s_m"),
    [(0.0, None, 50.0), (-2.0, None, 70.0), (3.0, None, 20.0), (-2.0, 1.0, 60.0)],
)
def test_a_log_beside_is_read_as_far_as_the_cars_time_has_come(
    tmp_path: Path, log_later_s: float, offset_s: float | None, at_5_s_m: float
) -> None:
    log = van_log(tmp_path, start_ns=START_NS + round(log_later_s * 1e9))
    config = OtherVehicleConfig(id="van", log=str(log), log_offset_s=offset_s)
    beside, heard = crew(tmp_path, config)
    drive(beside, until_s=5.0)
    assert len(heard) == 101
    for message in heard:
        assert all(one.state.stamp_ns <= message.stamp_ns for one in message.heard)
    last = heard[-1].heard[-1].state
    assert (last.vehicle_id, last.stamp_ns) == ("van", own(5.0).stamp_ns)
    assert x_of(last) == pytest.approx(at_5_s_m, abs=0.3)
    told = [command for message in heard for one in message.heard for command in one.commands]
    assert told
    assert all(command.stamp_ns <= own(5.0).stamp_ns for command in told)


def test_who_is_on_the_bus_is_estimated_from_what_it_sends(tmp_path: Path) -> None:
    beside, heard = crew(tmp_path, OtherVehicleConfig(id="van", live=True, same_clock=True))
    bus, box = MemoryBus(), Mailbox(64)
    for channel in ("gnss", "speed"):
        bus.subscribe(channel, box, vehicle="van")
    for k in range(30):
        ns = START_NS + k * 100_000_000
        bus.publish("gnss", GnssFix(stamp_ns=ns, position=at(k)), vehicle="van")
        bus.publish("speed", SpeedSample(stamp_ns=ns, speed_mps=10.0), vehicle="van")
        while (item := box.take()) is not None:
            beside.take_sample("van", item)
    drive(beside, until_s=2.9)
    states = [one.state for message in heard for one in message.heard]
    assert x_of(states[-1]) == pytest.approx(29.0, abs=0.5)
    assert {state.vehicle_id for state in states} == {"van"}
    assert ASKED == ["van"]
    assert TOLD[0] == "van is heard"


def on_the_bus(
    beside: OtherVehicleFeed, *, from_s: float, to_s: float, later_s: float = 0.0
) -> None:
    """Let the van drive east at 10 m/s; its antenna is where its position is measured."""
    bus, box = MemoryBus(), Mailbox(64)
    for channel in ("gnss", "speed"):
        bus.subscribe(channel, box, vehicle="van")
    for k in range(round(from_s * 10), round(to_s * 10)):
        ns = START_NS + k * 100_000_000 + round(later_s * 1e9)
        bus.publish("gnss", GnssFix(stamp_ns=ns, position=at(k)), vehicle="van")
        bus.publish("speed", SpeedSample(stamp_ns=ns, speed_mps=10.0), vehicle="van")
        while (item := box.take()) is not None:
            beside.take_sample("van", item)


def test_who_is_on_the_bus_is_placed_by_its_antenna_once_it_says_where_that_sits(
    tmp_path: Path,
) -> None:
    beside, heard = crew(tmp_path, OtherVehicleConfig(id="van", live=True, same_clock=True))
    on_the_bus(beside, from_s=0.0, to_s=2.0)
    said = msgspec.structs.replace(INFO, vehicle_id="van", body_from_antenna_m=(1.5, 0.0, 0.0))
    beside.take_info("van", said)
    on_the_bus(beside, from_s=2.0, to_s=5.0)
    beside.keep_up_with(own(4.9), None, ROLES)
    assert x_of(heard[-1].heard[-1].state) == pytest.approx(49.0 - 1.5, abs=0.5)
    assert ASKED == ["van"]


def test_stamps_of_another_clock_are_told_once(tmp_path: Path) -> None:
    beside, _ = crew(tmp_path, OtherVehicleConfig(id="van", live=True, same_clock=True))
    for second in (0.0, 2.0):
        on_the_bus(beside, from_s=second, to_s=second + 2.0, later_s=30.0)
        beside.keep_up_with(own(second + 1.9), None, ROLES)
    (told,) = (text for text in TOLD if "clock" in text)
    assert told.startswith("van stamps 30.0 s ahead of the car")


def user(user_id: str, x_m: float, *, yaw: float = 0.0, kind: str = "car") -> RoadUser:
    return RoadUser(
        user_id=user_id, kind=kind, position=at(x_m), yaw_rad=yaw, speed_mps=5.0,  # type: ignore[arg-type]
        length_m=4.0, width_m=1.7,
    )  # fmt: skip


def test_who_the_car_detects_has_its_pose_at_the_rear_axle(tmp_path: Path) -> None:
    beside, heard = crew(tmp_path, OtherVehicleConfig(id="van", seen_as="17"))
    for k in range(3):
        users = RoadUsers(
            stamp_ns=own(k / 10).stamp_ns, users=(user("17", 20.0, yaw=0.1 * k), user("4", 9.0))
        )
        beside.keep_up_with(own(k / 10), users, ROLES)
        beside.keep_up_with(own(k / 10 + 0.05), users, ROLES)
    states = [one.state for message in heard for one in message.heard]
    assert len(states) == 3
    assert x_of(states[0]) == pytest.approx(20.0 - box_centre_from_base_m(VAN), abs=1e-3)
    assert [round(state.yaw_rate_radps, 6) for state in states] == [0.0, 1.0, 1.0]


def test_futures_meet_twins_and_shadows_once_and_no_ghosts(tmp_path: Path) -> None:
    log = van_log(tmp_path, start_ns=START_NS)
    beside, _ = crew(
        tmp_path,
        OtherVehicleConfig(id="van", log=str(log)),
        OtherVehicleConfig(id="other", seen_as="17"),
    )
    drive(beside, until_s=2.0)
    now = own(2.0)
    users = (user("17", 60.0), user("5", 21.0), user("6", 40.0))
    seen = RoadUsers(stamp_ns=now.stamp_ns, users=users)
    beside.keep_up_with(now, seen, ROLES)
    said = LatestReports(None, seen, ())

    def ids(**roles: str) -> list[str]:
        found = beside.among(said, now, roles).road_users  # type: ignore[arg-type]
        assert found is not None
        assert found.stamp_ns == now.stamp_ns
        return [one.user_id for one in found.users]

    # The detection 5 is the van itself; 17 goes by the name that it was given.
    assert ids(van="shadow", other="twin") == ["6", "van", "other"]
    assert ids(van="ghost", other="shadow") == ["5", "6", "other"]
    assert ids(van="twin", other="ghost") == ["6", "van"]
    # Who has not been heard of for a while is not there.
    later = own(9.0)
    assert beside.among(said, later, {"van": "twin"}).road_users == RoadUsers(
        stamp_ns=later.stamp_ns, users=()
    )


def test_the_van_as_a_road_user_has_its_own_size_and_centre(tmp_path: Path) -> None:
    beside, _ = crew(
        tmp_path, OtherVehicleConfig(id="van", log=str(van_log(tmp_path, start_ns=START_NS)))
    )
    drive(beside, until_s=2.0)
    users = beside.among(LatestReports(None, None, ()), own(2.3), {"van": "twin"}).road_users
    assert users is not None
    (van,) = users.users
    assert (van.length_m, van.width_m) == (VAN.length_m.value, VAN.width_m.value)
    centre = local_from_geo(FRAME, van.position.lat_deg, van.position.lon_deg)
    assert centre[0] == pytest.approx(23.0 + box_centre_from_base_m(VAN), abs=0.3)


@pytest.mark.parametrize(("role", "met"), [("shadow", {"van"}), ("ghost", set())])
def test_jobs_of_a_drive_hold_who_is_beside_the_car(tmp_path: Path, role: Role, met: set) -> None:
    house = House(tmp_path, futures=2)
    config = OtherVehicleConfig(id="van", seen_as="17", role=role)
    plan = replace(house.plan, beside=(OtherVehiclePlan(config, VAN, commands_recorded=False),))
    house.conductor.beside = OtherVehicleFeed(replace(house.conductor.context, plan=plan))
    house.conductor.beside.begin(INFO)
    house.conductor.roles.roles["van"] = role
    house.drive(25)
    car = house.states[25]
    ahead = RoadUser(
        user_id="17", kind="car", position=house.states[27].position, yaw_rad=car.yaw_rad,
        speed_mps=5.0, length_m=4.0, width_m=1.7,
    )  # fmt: skip
    users = RoadUsers(stamp_ns=car.stamp_ns, users=(ahead,))
    house.bus.publish("objects", users, vehicle="ego")
    house.send(car)
    house.settle()
    assert house.conductor.start_round()
    jobs = [request.message().decoded() for worker in house.workers for request in worker.take()]
    assert {user.length_m for job in jobs for user in job.road_users} == {
        VAN.length_m.value for _ in met
    }
    house.tables.close()
