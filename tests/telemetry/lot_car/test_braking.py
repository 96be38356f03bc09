"""The stand-in on an empty lot brakes for whom only the World holds, in both dialects."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from msgspec.structs import replace

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import GnssFix, SpeedSample, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.foreign_bus import Arrived
from foretwin.contracts.frames import GeoPoint, geo_pose
from foretwin.contracts.towards_vehicle import Authority
from foretwin.telemetry.lot_car.lot_car import LotCar, heard_objects
from foretwin.telemetry.lot_car.ros_voice import RosVoice
from foretwin.telemetry.ros2.gateway import Gateway
from foretwin.telemetry.ros2.lot_guard import LotGuard
from foretwin.telemetry.ros2.mapping import listening_only, parse_mapping
from foretwin.telemetry.ros2.safety import GateTrouble
from foretwin.telemetry.standin.obstacles import FRONT_M
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import StandinSource
from tests.contracts.memory_bus import MemoryBus
from tests.telemetry.ros2.order_side import OrderSide

COVERS = (
    "foretwin.telemetry.lot_car.lot_car",
    "foretwin.telemetry.lot_car.ros_voice",
)
S, MS = 10**9, 10**6
WALL_NS = 1_790_000_000 * S
ANCHOR = Anchor(
    lot=AnchorPose(lat_deg=52.4739, lon_deg=13.395, yaw_deg=2.0),
    world=AnchorPose(lat_deg=52.5128636, lon_deg=13.3914225, yaw_deg=-84.21),
)
FENCE_M = ((-40.0, -60.0), (110.0, -60.0), (110.0, 60.0), (-40.0, 60.0))
"""Of the lot, from its point."""
MAPPING = """
dialect = "{dialect}"
antenna_m = [0.95, 0.0, 1.45]
[map]
lat_deg = 52.4739
lon_deg = 13.395
[[in]]
topic = "/sensing/gnss/fix"
type = "sensor_msgs/msg/NavSatFix"
channel = "gnss"
[[in]]
topic = "/sensing/imu"
type = "sensor_msgs/msg/Imu"
channel = "imu"
[[in]]
topic = "/vehicle/status/velocity_status"
type = "autoware_vehicle_msgs/msg/VelocityReport"
channel = "speed"
[[in]]
topic = "/vehicle/status/steering_status"
type = "autoware_vehicle_msgs/msg/SteeringReport"
channel = "steering"
[[in]]
topic = "/vehicle/status/control_mode"
type = "autoware_vehicle_msgs/msg/ControlModeReport"
channel = "status"
[[in]]
topic = "/vehicle/status/gear_status"
type = "autoware_vehicle_msgs/msg/GearReport"
channel = "status"
[[in]]
topic = "/control/command/control_cmd"
type = "autoware_control_msgs/msg/Control"
channel = "control"
[[in]]
topic = "/planning/trajectory"
type = "autoware_planning_msgs/msg/Trajectory"
channel = "plan"
[[out]]
topic = "/virtual/objects"
type = "autoware_perception_msgs/msg/{objects}"
source = "virtual_objects"
[[virtual]]
id = "walker"
kind = "pedestrian"
lat_deg = {lat}
lon_deg = {lon}
length_m = 0.5
width_m = 0.6
[towards_vehicle]
enabled = true
"""


def matches(pattern: str, key: str) -> bool:
    parts, words = pattern.split("/"), key.split("/")
    return len(parts) == len(words) and all(
        part in ("*", word) for part, word in zip(parts, words, strict=True)
    )


class Wire:
    """The car's own Zenoh, with a clock in the test's hand."""

    session_id, connected = "ab12", True

    def __init__(self) -> None:
        self.now_ns = S
        self._ends: list[tuple[str, Mailbox]] = []

    def subscribe(self, key: str, mailbox: Mailbox, *, history: bool = False) -> None:
        self._ends.append((key, mailbox))

    def put(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        arrived = Arrived(key, payload, attachment, self.now_ns, WALL_NS + self.now_ns)
        for pattern, mailbox in self._ends:
            if matches(pattern, key):
                mailbox.put(arrived)

    def declare_alive(self, token: str) -> None: ...

    def watch_alive(self, tokens: str, mailbox: Mailbox) -> None: ...


class Meeting:
    """The stand-in on its lot, the gateway, and who knows the car's state in the World.

    `ahead_m` is of the World, where a lot of `scale` 10 is ten times as large.
    """

    def __init__(self, dialect: str, objects: str, *, ahead_m: float, scale: float = 1.0) -> None:
        anchor = replace(ANCHOR, scale=scale)
        self.wire, self.bus, self.orders = Wire(), MemoryBus(), OrderSide("r")
        cos, sin = math.cos(ANCHOR.world.yaw_rad), math.sin(ANCHOR.world.yaw_rad)
        at = geo_pose(ANCHOR.world.frame, ahead_m * cos, ahead_m * sin, 0.0).position
        text = MAPPING.format(dialect=dialect, objects=objects, lat=at.lat_deg, lon=at.lon_deg)
        mapping = parse_mapping(text, name="m.toml")
        mapping = replace(mapping, antenna_m=tuple(one / scale for one in mapping.antenna_m or ()))
        corners_m = np.array(FENCE_M) / scale
        fence = [geo_pose(ANCHOR.lot.frame, x, y, 0.0).position for x, y in corners_m.tolist()]
        self.gateway = Gateway(
            mapping, bus=self.bus, foreign=self.wire, run_id="r", vehicle_id="ego",
            drive_frame=ANCHOR.world.frame, flag_on=True, order_keys=self.orders.keys,
            anchor=anchor, mono_ns=lambda: self.wire.now_ns,
            wall_ns=lambda: WALL_NS + self.wire.now_ns,
            guard=LotGuard(
                [(one.lat_deg, one.lon_deg) for one in fence], frame=ANCHOR.lot.frame,
                reach_m=4.0 / scale,
            ),
        )  # fmt: skip
        parameters = read_parameters()
        self.car = LotCar(
            mapping,
            StandinSource(straight(100.0, at=ANCHOR.world), parameters, vehicle_id="ego"),
            foreign=self.wire, anchor=anchor, steering_ratio=parameters.car.steering_ratio,
            mono_ns=lambda: self.wire.now_ns, wall_ns=lambda: WALL_NS + self.wire.now_ns,
        )  # fmt: skip
        self.heard = Mailbox(10_000)
        for channel in ("gnss", "speed"):
            self.bus.subscribe(channel, self.heard, vehicle="ego")
        self.fix: GnssFix | None = None
        self.speed_mps = 0.0

    def go_on(self, for_s: float) -> None:
        for _ in range(round(for_s * 50)):
            self.wire.now_ns += 20 * MS
            self.car.step(0.0)
            self.gateway.step(0.0)
            while (item := self.heard.take()) is not None:
                match item.message():
                    case GnssFix() as fix:
                        self.fix = fix
                    case SpeedSample() as sample:
                        self.speed_mps = sample.speed_mps
            self.orders.say(self.bus, Authority(sent_mono_ns=self.wire.now_ns))
            if self.fix is not None:
                self.bus.publish("state", self._state(self.fix.position), vehicle="ego")
            self.gateway.step(0.0)

    def _state(self, position: GeoPoint) -> VehicleState:
        return VehicleState(
            vehicle_id="ego", stamp_ns=WALL_NS + self.wire.now_ns, position=position,
            yaw_rad=ANCHOR.world.yaw_rad, speed_mps=self.speed_mps, yaw_rate_radps=0.0,
            accel_mps2=0.0,
        )  # fmt: skip


def straight(way_m: float, *, at: AnchorPose = ANCHOR.lot) -> DrivenPath:
    cos, sin = math.cos(at.yaw_rad), math.sin(at.yaw_rad)
    ends = [geo_pose(at.frame, s * cos, s * sin, 0.0).position for s in (0.0, way_m)]
    return DrivenPath(
        np.array([one.lat_deg for one in ends]), np.array([one.lon_deg for one in ends]),
        np.array([8.0, 8.0]), driver=read_parameters().driver,
    )  # fmt: skip


@functools.cache
def before_a_pedestrian(dialect: str, objects: str, scale: float) -> Meeting:
    meeting = Meeting(dialect, objects, ahead_m=25.0, scale=scale)
    meeting.go_on(10.0)
    assert meeting.gateway.gate.state == "open", meeting.gateway.gate.why
    return meeting


@pytest.mark.parametrize(
    ("dialect", "objects"), [("ros2dds", "PredictedObjects"), ("rmw_zenoh", "DetectedObjects")]
)
def test_on_an_empty_lot_it_stands_before_a_pedestrian_of_the_world(dialect: str, objects: str):
    meeting = before_a_pedestrian(dialect, objects, 1.0)
    report = meeting.car.report()
    assert report.brakes == ("pedestrian",)
    assert report.lists > 90
    assert report.stood_before_m == pytest.approx(2.0, abs=0.5)
    assert report.braked_at_m is not None
    assert 5.0 < report.braked_at_m < 20.0
    # The pedestrian stands 25 m on, and nothing but the World knows of it.
    assert report.driven_m == pytest.approx(25.0 - 0.3 - FRONT_M - 2.0, abs=0.6)
    counts = meeting.gateway.report()["in"]
    assert {"gnss", "imu", "speed", "steering", "status", "control", "plan"} <= counts.keys()
    assert meeting.gateway.report()["unused"] == {}


def test_a_car_of_1_10_stands_a_tenth_as_far_before_whom_it_hears_of() -> None:
    large, small = (before_a_pedestrian("ros2dds", "PredictedObjects", k) for k in (1.0, 10.0))
    reports = [one.car.report() for one in (large, small)]
    assert [one.brakes for one in reports] == [("pedestrian",)] * 2
    for name in ("stood_before_m", "braked_at_m", "driven_m"):
        in_world, on_lot = (getattr(one, name) for one in reports)
        assert 10.0 * on_lot == pytest.approx(in_world, abs=0.3), name
    assert large.fix is not None
    assert small.fix is not None
    assert small.fix.std_m == pytest.approx(large.fix.std_m)


def test_when_injection_ends_it_goes_on_by_what_it_sees_itself():
    meeting = Meeting("ros2dds", "PredictedObjects", ahead_m=15.0)
    meeting.go_on(7.0)
    assert meeting.car.report().stood_before_m is not None
    stood_at_m = meeting.car.report().driven_m
    meeting.gateway.gate.shut(GateTrouble("link down", "the test says so"))
    meeting.go_on(4.0)
    assert meeting.car.report().driven_m > stood_at_m + 2.0
    assert meeting.gateway.report()["sent"]["/virtual/objects"] == meeting.car.report().lists


def test_a_list_that_is_a_second_old_says_nothing_of_now():
    meeting = Meeting("ros2dds", "PredictedObjects", ahead_m=12.0)
    meeting.go_on(6.0)
    stood_at_m = meeting.car.report().driven_m
    assert meeting.car.report().stood_before_m is not None
    for seconds, goes_on in ((0.9, False), (3.0, True)):
        for _ in range(round(50 * seconds)):
            meeting.wire.now_ns += 20 * MS
            meeting.car.step(0.0)
        assert (meeting.car.report().driven_m > stood_at_m + 0.2) == goes_on


def test_without_a_word_it_stands_and_says_its_samples():
    meeting = Meeting("ros2dds", "PredictedObjects", ahead_m=15.0)
    for _ in range(100):
        meeting.wire.now_ns += 20 * MS
        meeting.car.step(0.0)
        meeting.gateway.step(0.0)
    report = meeting.car.report()
    assert (report.lists, report.latency_ms_p95, report.brakes) == (0, None, ())
    assert report.driven_m == pytest.approx(0.0, abs=0.05)
    assert meeting.gateway.report()["in"]["gnss"] == pytest.approx(20, abs=1)


def test_it_says_its_samples_as_they_are_due_not_as_its_turn_ends():
    meeting = Meeting("ros2dds", "PredictedObjects", ahead_m=15.0)
    waited_s: list[float] = []

    def take(timeout_s: float = 0.0) -> None:
        waited_s.append(timeout_s)
        meeting.wire.now_ns += round(timeout_s * S)

    meeting.car._inbox.take = take  # type: ignore[method-assign]
    meeting.wire.now_ns += 3 * MS
    for _ in range(4):
        meeting.car.step()
    assert waited_s == pytest.approx([0.0, 0.007, 0.010, 0.010])


def test_a_mapping_that_sends_the_car_no_objects_is_refused():
    text = MAPPING.format(dialect="ros2dds", objects="PredictedObjects", lat=52.5, lon=13.4)
    mapping = parse_mapping(text, name="m.toml")
    assert heard_objects(mapping).topic == "/virtual/objects"
    with pytest.raises(UserError, match="virtual_objects"):
        heard_objects(listening_only(mapping))


def test_a_plan_is_said_where_map_is_placed_alone():
    text = MAPPING.format(dialect="ros2dds", objects="PredictedObjects", lat=52.5, lon=13.4)
    mapping = parse_mapping(text, name="m.toml")
    assert "plan" in RosVoice(mapping, steering_ratio=15.3).channels
    assert "plan" not in RosVoice(replace(mapping, map_place=None), steering_ratio=15.3).channels
