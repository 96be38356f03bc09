"""Vehicles of the mirror as virtual objects: who goes out, where to, and what is held back."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.roles import Role
from foretwin.contracts.simulation import MirroredVehicle, MirrorSample, PlaneState
from foretwin.contracts.towards_vehicle import Authority
from foretwin.orchestrator.config import DriveConfig, OtherVehicleConfig
from foretwin.orchestrator.drive.ros2_mapping import read_ros2
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.ros2.gateway import Gateway
from foretwin.telemetry.ros2.mapping import MappingError, parse_mapping
from foretwin.telemetry.ros_messages.parts import (
    DETECTED_OBJECTS,
    PREDICTED_OBJECTS,
    typestore,
    yaw_of,
)
from tests.contracts.memory_bus import MemoryBus
from tests.contracts.mirror_samples import mirror_sample
from tests.telemetry.ros2.gateway_ground import RecordingForeign
from tests.telemetry.ros2.order_side import OrderSide

COVERS = ("foretwin.telemetry.ros2.outwards",)
S = 10**9
CAR = load_vehicle(None)
TEXT = """
dialect = "{dialect}"
[map]
lat_deg = 52.5
lon_deg = 13.4
[mirrored]
own_twin = true
vehicles = ["van", "second"]
[[out]]
topic = "/foretwin/objects"
type = "autoware_perception_msgs/msg/DetectedObjects"
source = "virtual_objects"
[[out]]
topic = "/virtual/objects"
type = "autoware_perception_msgs/msg/PredictedObjects"
source = "virtual_objects"
[towards_vehicle]
enabled = true
"""
DRIVE_FRAME = LocalFrame(GeoPoint(52.501, 13.402))
NORTH_M, EAST_M = 111.26, 135.8
"""Of the drive's frame in the map's."""


def vehicle(name: str, role: Role, *, x_m: float, yaw_rad: float = 0.0) -> MirroredVehicle:
    return MirroredVehicle(
        vehicle_id=name,
        role=role,
        real=PlaneState(999.0, 0.0, 0.0, 0.0),
        shown=PlaneState(x_m, 0.0, yaw_rad, 5.0),
        length_m=6.0,
        width_m=2.0,
        height_m=2.0,
        rear_overhang_m=1.0,
    )


def mirror(stamp_ns: int, *others: MirroredVehicle, role: Role = "all") -> MirrorSample:
    car = PlaneState(0.0, 0.0, 0.0, 7.0)
    twin = PlaneState(0.5, 0.0, 0.0, 7.0)
    return mirror_sample(
        stamp_ns, car, twin=twin, gap_m=0.5, gap_along_m=0.5, role=role, others=others
    )


class Ground:
    """A gateway beside a run whose orchestrator is in charge."""

    def __init__(self, *, dialect: str = "rmw_zenoh", flag: bool = True) -> None:
        self.now_ns = S
        self.bus, self.foreign = MemoryBus(), RecordingForeign()
        self.orders = OrderSide("r")
        self.gateway = Gateway(
            parse_mapping(TEXT.format(dialect=dialect), name="m.toml"),
            bus=self.bus,
            foreign=self.foreign,
            run_id="r",
            vehicle_id="ego",
            drive_frame=DRIVE_FRAME,
            flag_on=flag,
            order_keys=self.orders.keys,
            car=CAR,
            mono_ns=lambda: self.now_ns,
            wall_ns=lambda: 10**18 + self.now_ns,
        )

    def drive_to(self, stamp_ns: int) -> None:
        state = VehicleState(
            vehicle_id="ego",
            stamp_ns=stamp_ns,
            position=GeoPoint(52.5, 13.4),
            yaw_rad=0.0,
            speed_mps=7.0,
            yaw_rate_radps=0.0,
            accel_mps2=0.0,
        )
        self.bus.publish("state", state, vehicle="ego")

    def say(self, sample: MirrorSample, *, passed_s: float = 0.1) -> None:
        self.now_ns += round(passed_s * S)
        self.orders.say(self.bus, Authority(sent_mono_ns=self.now_ns))
        self.bus.publish("mirror", sample, run="r")
        self.gateway.step(0.0)

    def own(self) -> list:
        """What goes out where nothing obeys."""
        return self._read("foretwin/objects", DETECTED_OBJECTS)

    def towards(self) -> list:
        return self._read("virtual/objects", PREDICTED_OBJECTS)

    def _read(self, topic: str, kind: str) -> list:
        return [
            typestore().deserialize_cdr(payload, kind)
            for key, payload in zip(self.foreign.put_keys, self.foreign.payloads, strict=True)
            if topic in key
        ]


@pytest.mark.parametrize("dialect", ["rmw_zenoh", "ros2dds"])
def test_a_twin_beside_goes_out_in_the_map_with_the_cars_stamp(dialect: str) -> None:
    ground = Ground(dialect=dialect)
    ground.say(mirror(5 * S, vehicle("van", "twin", x_m=30.0, yaw_rad=math.pi / 2)))
    (message,) = ground.towards()
    assert (message.header.frame_id, message.header.stamp.sec) == ("map", 5)
    (van,) = message.objects
    at = van.kinematics.initial_pose_with_covariance.pose
    # Its middle lies 2 m ahead of the rear axle, to the north.
    assert (at.position.x, at.position.y) == (
        pytest.approx(EAST_M + 30.0, abs=0.2),
        pytest.approx(NORTH_M + 2.0, abs=0.2),
    )
    assert yaw_of(at.orientation) == pytest.approx(math.pi / 2, abs=1e-3)
    assert van.kinematics.initial_twist_with_covariance.twist.linear.x == 5.0
    assert (van.shape.dimensions.x, van.shape.dimensions.y) == (6.0, 2.0)
    where = ground.foreign.put_keys.index(
        next(key for key in ground.foreign.put_keys if "virtual/objects" in key)
    )
    attachment = ground.foreign.attachments[where]
    if dialect == "ros2dds":
        assert ground.foreign.put_keys[where] == "virtual/objects"
        assert attachment is None
        assert ground.foreign.tokens == []
    else:
        assert "RIHS01_" in ground.foreign.put_keys[where]
        assert attachment is not None
        assert len(attachment) == 33
        assert any("%virtual%objects" in token for token in ground.foreign.tokens)


def test_the_cars_own_twin_never_goes_towards_the_vehicle() -> None:
    ground = Ground()
    ground.say(mirror(5 * S, vehicle("van", "shadow", x_m=30.0)))
    (seen,), (obeyed,) = ground.own(), ground.towards()
    assert len(seen.objects) == 2
    assert len(obeyed.objects) == 1
    sizes_m = {round(one.shape.dimensions.x, 3) for one in seen.objects}
    assert sizes_m == {round(float(np.float32(CAR.length_m.value)), 3), 6.0}
    # Where the car is no twin, there is none.
    ground.say(mirror(5 * S + S, vehicle("van", "shadow", x_m=31.0), role="shadow"), passed_s=1.0)
    assert len(ground.own()[-1].objects) == 1


def test_ghosts_and_who_was_not_named_stay_here() -> None:
    ground = Ground()
    others = (vehicle("van", "ghost", x_m=30.0), vehicle("else", "twin", x_m=50.0))
    ground.say(mirror(5 * S, *others))
    assert [len(message.objects) for message in ground.towards()] == [0]


def test_a_role_set_to_ghost_takes_it_away_within_half_a_second() -> None:
    ground = Ground()
    stamp_ns = 5 * S
    ground.say(mirror(stamp_ns, vehicle("van", "twin", x_m=30.0)))
    for _ in range(6):
        stamp_ns += S // 10
        ground.say(mirror(stamp_ns, vehicle("van", "ghost", x_m=30.0)))
    assert [len(message.objects) for message in ground.towards()] == [1, 1, 1, 1, 1, 1, 0]


@pytest.mark.parametrize("flag", [True, False])
def test_nothing_obeys_a_mirror_without_both_switches_or_without_an_orchestrator(
    flag: bool,
) -> None:
    ground = Ground(flag=flag)
    ground.say(mirror(5 * S, vehicle("van", "twin", x_m=30.0)))
    assert len(ground.towards()) == (1 if flag else 0)
    ground.now_ns += 160_000_000
    ground.bus.publish("mirror", mirror(6 * S, vehicle("van", "twin", x_m=31.0)), run="r")
    ground.gateway.step(0.0)
    # The last word is that nobody is there.
    assert [len(one.objects) for one in ground.towards()] == ([1, 0] if flag else [])
    assert len(ground.own()) == 2


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"shown": PlaneState(math.nan, 0.0, 0.0, 5.0)}, "not finite"),
        ({"shown": PlaneState(0.0, 0.0, 0.0, 101.0)}, "impossible size or speed"),
        ({"length_m": 51.0}, "impossible size or speed"),
    ],
)
def test_what_no_vehicle_can_be_is_held_and_counted(wrong: dict, why: str) -> None:
    ground = Ground()
    ground.say(mirror(5 * S, msgspec.structs.replace(vehicle("van", "twin", x_m=3.0), **wrong)))
    assert ground.towards() == []
    report = ground.gateway.report()
    assert [name for name in report["held"] | report["refused"] if why in name]


def test_a_mirror_that_lags_is_held() -> None:
    ground = Ground()
    ground.drive_to(6 * S)
    ground.say(mirror(6 * S - 400_000_000, vehicle("van", "twin", x_m=30.0)))
    ground.say(mirror(6 * S - 600_000_000, vehicle("van", "twin", x_m=31.0)))
    assert len(ground.towards()) == 1
    assert ground.gateway.held["a mirror that lags behind the car"] == 1


def test_stamps_of_the_list_never_go_back_with_two_senders() -> None:
    ground = Ground()
    ground.say(mirror(5 * S, vehicle("van", "twin", x_m=30.0)))
    ground.say(mirror(5 * S - S // 10, vehicle("second", "twin", x_m=30.0)))
    first, second = ground.towards()
    assert (second.header.stamp.sec, second.header.stamp.nanosec) == (5, 0)
    assert (len(first.objects), len(second.objects)) == (1, 2)
    places = sorted(
        one.kinematics.initial_pose_with_covariance.pose.position.x for one in second.objects
    )
    # The second has driven on for a tenth of a second.
    assert places[1] - places[0] == pytest.approx(0.5, abs=0.01)
    # A clock set back by more is followed.
    ground.say(mirror(2 * S, vehicle("van", "twin", x_m=30.0)))
    assert ground.towards()[-1].header.stamp.sec == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('dialect = "ros2dds"\n[mirrored]\nvehicles = ["van"]', "without an .*goes nowhere"),
        (
            TEXT.format(dialect="ros2dds").replace("/foretwin/objects", "/other/objects"),
            r"own_twin: needs a topic below /foretwin/",
        ),
        (
            TEXT.format(dialect="ros2dds").replace("own_twin", "twin"),
            "line 7: unknown key 'twin' in mirrored; did you mean own_twin",
        ),
    ],
)
def test_mappings_that_cannot_be_used_say_why(text: str, said: str) -> None:
    with pytest.raises(MappingError, match=said):
        parse_mapping(text, name="m.toml")


@pytest.mark.parametrize(
    ("vehicles", "said"),
    [
        (
            (OtherVehicleConfig(id="van", live=True),),
            "'second': not in the drive's .*which are van",
        ),
        (
            (OtherVehicleConfig(id="van", live=True), OtherVehicleConfig(id="second", seen_as="4")),
            "'second': the car detects it itself",
        ),
    ],
)
def test_who_goes_out_must_be_in_the_drive(
    tmp_path, vehicles: tuple[OtherVehicleConfig, ...], said: str
) -> None:
    file = tmp_path / "m.toml"
    file.write_text(TEXT.format(dialect="ros2dds"))
    config = DriveConfig(source="live", ros2=str(file), vehicles=vehicles, map="x")
    with pytest.raises(MappingError, match=said) as refused:
        read_ros2(config)
    assert "\n" not in str(refused.value)
