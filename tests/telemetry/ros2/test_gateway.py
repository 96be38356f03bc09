"""The gateway in one process: samples in, states out, and nothing towards the vehicle unasked."""

from __future__ import annotations

import math

import pytest

from foretwin.contracts.anchor import Anchor
from foretwin.contracts.bounds import MOST_ROS_BYTES
from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import GnssFix, RoadUser, RoadUsers, SteeringSample, VehicleState
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.simulation import PlaneState
from foretwin.contracts.towards_vehicle import Authority, VehicleCommand
from foretwin.telemetry.ros2.gateway import Gateway
from foretwin.telemetry.ros2.lot_guard import LotGuard
from foretwin.telemetry.ros2.mapping import parse_mapping
from foretwin.telemetry.ros_messages.foreign import FOREIGN
from foretwin.telemetry.ros_messages.parts import (
    ODOMETRY,
    VELOCITY_REPORT,
    typestore,
    yaw_of,
)
from tests.contracts.memory_bus import MemoryBus
from tests.contracts.mirror_samples import mirror_sample
from tests.telemetry.autoware_messages import velocity_report
from tests.telemetry.ros2.gateway_ground import (
    FIX_KEY,
    FRAME,
    STEERING_KEY,
    TF_KEY,
    RecordingForeign,
    antenna_at,
    fix,
    mapping_text,
    steering,
)
from tests.telemetry.ros2.order_side import OrderSide

COVERS = (
    "foretwin.telemetry.ros2.inwards",
    "foretwin.telemetry.ros2.outwards",
)

S = 10**9
TOWARDS = ("/control/cmd", "/perception/objects", "/clock")
SPEED = f"""
[[in]]
topic = "/vehicle/velocity"
type = "{VELOCITY_REPORT}"
channel = "speed"
"""
SPEED_KEY = "0/vehicle/velocity/autoware_vehicle_msgs::msg::dds_::VelocityReport_/RIHS01_x"


def state(stamp_ns: int) -> VehicleState:
    return VehicleState(
        vehicle_id="ego",
        stamp_ns=stamp_ns,
        position=GeoPoint(52.5, 13.4),
        yaw_rad=0.0,
        speed_mps=1.0,
        yaw_rate_radps=0.0,
        accel_mps2=0.0,
    )


class Ground:
    """A gateway with a clock in the test's hand."""

    def __init__(
        self,
        *,
        enabled: bool,
        flag: bool,
        keys: bool = True,
        anchor: Anchor | None = None,
        guard: LotGuard | None = None,
        **mapped: str,
    ) -> None:
        self.now_ns = S
        self.bus, self.foreign = MemoryBus(), RecordingForeign()
        self.inbox = Mailbox(100)
        for channel in ("gnss", "steering"):
            self.bus.subscribe(channel, self.inbox, vehicle="ego")
        self.orders = OrderSide("r")
        self.gateway = Gateway(
            parse_mapping(mapping_text(enabled=enabled, **mapped), name="m.toml"),
            bus=self.bus,
            foreign=self.foreign,
            run_id="r",
            vehicle_id="ego",
            drive_frame=FRAME,
            flag_on=flag,
            order_keys=self.orders.keys if keys else None,
            anchor=anchor,
            guard=guard,
            mono_ns=lambda: self.now_ns,
            wall_ns=lambda: 10**18 + self.now_ns,
        )

    def arrive(self, key: str, payload: bytes, seq: int = 1) -> None:
        self.foreign.arrive(key, payload, mono_ns=self.now_ns, seq=seq)
        self.step()

    def step(self, passed_ms: float = 0.0) -> None:
        self.now_ns += round(passed_ms * 1e6)
        self.gateway.step(0.0)

    def say_everything(self) -> None:
        """The orchestrator is in charge and says all that could go towards a vehicle."""
        self.arrive(STEERING_KEY + "RIHS01_x", steering(5 * S, 0.1))
        self.orders.say(self.bus, Authority(sent_mono_ns=self.now_ns))
        self.step()
        command = VehicleCommand(
            stamp_ns=0, sent_mono_ns=self.now_ns, tire_angle_rad=0.2, accel_mps2=9.0, speed_mps=99.0
        )
        self.orders.say(self.bus, command)
        user = RoadUser(
            user_id="u",
            kind="car",
            position=GeoPoint(52.5, 13.4),
            yaw_rad=0.0,
            speed_mps=1.0,
            length_m=4.0,
            width_m=2.0,
            virtual=True,
        )
        users = RoadUsers(stamp_ns=5 * S, users=(user,))
        self.bus.publish("virtual_objects", users, run="r")
        self.bus.publish("state", state(5 * S), vehicle="ego")
        self.step()

    def towards(self) -> dict[str, int]:
        return {topic: len(self.foreign.on(topic)) for topic in TOWARDS}


def test_ros_samples_become_telemetry() -> None:
    ground = Ground(enabled=False, flag=False)
    ground.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5))
    ground.arrive(STEERING_KEY + "TypeHashNotSupported", steering(5 * S + 1, 0.25))
    first, second = ground.inbox.take(), ground.inbox.take()
    assert first is not None
    assert second is not None
    assert first.message() == GnssFix(
        stamp_ns=5 * S, position=GeoPoint(52.6, 13.5, 40.0), std_m=pytest.approx(0.2)
    )
    assert second.message() == SteeringSample(stamp_ns=5 * S + 1, tire_angle_rad=0.25)
    info = ground.gateway.introduction.info()
    assert info is not None
    assert (info.start_stamp_ns, info.sends) == (5 * S, ("gnss", "steering"))


def test_what_cannot_be_used_is_counted_and_survived() -> None:
    ground = Ground(enabled=False, flag=False)
    ground.arrive(FIX_KEY, b"\x00\x01\x00\x00short")
    ground.arrive(FIX_KEY, fix(5 * S, math.nan, 13.5))
    ground.arrive("0/sensing/gnss/sensor_msgs::msg::dds_::Imu_/RIHS01_x", fix(5 * S, 52.0, 13.0))
    ground.arrive(STEERING_KEY + "x", fix(5 * S, 52.0, 13.0))
    ground.arrive("a/b", fix(5 * S, 52.0, 13.0))
    ground.arrive(FIX_KEY, fix(5 * S, 52.0, 13.0).ljust(MOST_ROS_BYTES + 1))
    ground.arrive(FIX_KEY.replace("gnss", "other"), fix(5 * S, 52.0, 13.0))
    assert ground.inbox.take() is None
    assert ground.gateway.report()["unused"] == {
        "a/b: no key of rmw_zenoh": 1,
        "/sensing/gnss: more than 4194304 bytes": 1,
        "/sensing/other: not mapped": 1,
        "/sensing/gnss: unreadable as sensor_msgs/msg/NavSatFix": 1,
        "/sensing/gnss: GnssFix: lat_deg not finite": 1,
        "/sensing/gnss: type sensor_msgs/msg/Imu instead of sensor_msgs/msg/NavSatFix": 1,
        "/vehicle/steering: unreadable as autoware_vehicle_msgs/msg/SteeringReport": 1,
    }
    ground.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5))
    assert ground.inbox.take() is not None


def test_no_message_ends_the_gateway(monkeypatch: pytest.MonkeyPatch) -> None:
    def read(*_: object) -> None:
        raise IndexError("an empty list")

    ground = Ground(enabled=False, flag=False)
    how = FOREIGN["sensor_msgs/msg/NavSatFix"]
    monkeypatch.setitem(FOREIGN, "sensor_msgs/msg/NavSatFix", how._replace(read=read))
    ground.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5))
    assert ground.gateway.report()["unused"] == {"/sensing/gnss: IndexError": 1}


def test_lost_samples_are_counted_by_sequence_number() -> None:
    ground = Ground(enabled=False, flag=False)
    for seq in (1, 2, 6, 5, 7):
        ground.arrive(FIX_KEY, fix(5 * S + seq, 52.6, 13.5), seq)
    # The fifth came late.
    assert ground.gateway.report()["lost"] == {"/sensing/gnss": 2}


def test_the_twin_goes_out_as_odometry() -> None:
    ground = Ground(enabled=False, flag=False)
    car = PlaneState(100.0, -50.0, 0.5, 7.0)
    mirror = mirror_sample(5 * S, car, twin_yaw_rate_radps=0.3)
    ground.bus.publish("mirror", mirror, run="r")
    ground.step()
    (data,) = ground.foreign.on("/foretwin/twin")
    odometry = typestore().deserialize_cdr(data, ODOMETRY)
    place = odometry.pose.pose.position
    assert (place.x, place.y) == (pytest.approx(100.0, abs=1e-6), pytest.approx(-50.0, abs=1e-6))
    assert yaw_of(odometry.pose.pose.orientation) == pytest.approx(0.5, abs=1e-9)
    assert odometry.twist.twist.linear.x == 7.0
    assert odometry.twist.twist.angular.z == 0.3
    assert odometry.header.frame_id == "map"


def test_what_ros_says_once_is_asked_for_again() -> None:
    ground = Ground(enabled=False, flag=False)
    assert "0/tf_static/*/* with history" in ground.foreign.subscribed
    assert "0/sensing/gnss/*/*" in ground.foreign.subscribed
    ground.arrive(TF_KEY, antenna_at(1.5, -0.1, 1.8))
    ground.arrive(FIX_KEY, fix(5 * S, 52.6, 13.5))
    info = ground.gateway.introduction.info()
    assert info is not None
    assert info.body_from_antenna_m == pytest.approx((1.5, -0.1, 1.8))


def test_real_road_users_never_go_out_as_virtual_ones() -> None:
    ground = Ground(enabled=True, flag=True)
    ground.say_everything()
    user = RoadUser(
        user_id="r",
        kind="car",
        position=GeoPoint(52.5, 13.4),
        yaw_rad=0.0,
        speed_mps=1.0,
        length_m=4.0,
        width_m=2.0,
    )
    ground.bus.publish("virtual_objects", RoadUsers(stamp_ns=6 * S, users=(user,)), run="r")
    ground.step(50.0)
    assert len(ground.foreign.on("/perception/objects")) == 1
    assert ground.gateway.report()["held"]["road users that are not marked as virtual"] == 1


@pytest.mark.parametrize(("enabled", "flag"), [(False, False), (True, False), (False, True)])
def test_nothing_goes_towards_the_vehicle_without_both_switches(enabled: bool, flag: bool) -> None:
    ground = Ground(enabled=enabled, flag=flag)
    for _ in range(5):
        ground.say_everything()
        ground.step(30.0)
    assert ground.towards() == dict.fromkeys(TOWARDS, 0)
    assert not [token for token in ground.foreign.tokens if "%control%cmd" in token]
    assert ground.foreign.on("/foretwin/diagnostics")


@pytest.mark.parametrize(
    ("speed_mps", "age_ms", "accel_mps2"),
    [(7.9, 0.0, 4.0 / 50.0), (7.9, 501.0, 0.0), (8.1, 0.0, 0.0), (None, 0.0, 0.0)],
)
def test_both_switches_let_it_out_within_its_bounds(
    speed_mps: float | None, age_ms: float, accel_mps2: float
) -> None:
    ground = Ground(enabled=True, flag=True, more=SPEED)
    if speed_mps is not None:
        report = velocity_report(5 * S, speed_mps=speed_mps, yaw_rate_radps=0.0)
        ground.arrive(SPEED_KEY, bytes(typestore().serialize_cdr(report, VELOCITY_REPORT)))
    ground.step(age_ms)
    ground.say_everything()
    assert ground.towards() == dict.fromkeys(TOWARDS, 1)
    data = ground.foreign.on("/control/cmd")[0]
    control = typestore().deserialize_cdr(data, "autoware_control_msgs/msg/Control")
    assert control.lateral.steering_tire_angle == pytest.approx(0.1 + 0.3 / 50.0)
    assert control.longitudinal.acceleration == pytest.approx(accel_mps2)
    assert control.longitudinal.velocity == pytest.approx(8.0)
    tokens = [token for token in ground.foreign.tokens if "%control%cmd" in token]
    assert len(tokens) == 1
    assert tokens[0].startswith("@ros2_lv/0/ab12/0/")
    attachment = ground.foreign.attachments[ground.foreign.payloads.index(data)]
    assert attachment is not None
    assert len(attachment) == 33


@pytest.mark.parametrize("end", ["silence", "link"])
def test_what_has_stopped_does_not_resume(end: str) -> None:
    ground = Ground(enabled=True, flag=True)
    ground.say_everything()
    if end == "link":
        ground.foreign.connected = False
        ground.step()
        ground.foreign.connected = True
    else:
        ground.step(151.0)
    before = ground.towards()
    for _ in range(10):
        ground.step(20.0)
        ground.say_everything()
    assert ground.towards() == before
    assert ground.gateway.gate.state == "shut"
