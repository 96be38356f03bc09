"""How often the gateway sends what, from where a command starts, and what it cannot send."""

from __future__ import annotations

import msgspec
import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.drive import RoadUsers
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.towards_vehicle import Authority, VehicleCommand
from foretwin.telemetry.ros2.mapping import parse_mapping
from foretwin.telemetry.ros2.outwards import Outwards
from foretwin.telemetry.ros2.virtual_objects import PlacedObject
from foretwin.telemetry.ros_messages.parts import (
    ACKERMANN,
    CONTROL,
    ODOMETRY,
    PREDICTED_OBJECTS,
    typestore,
)
from tests.telemetry.ros2.gateway_ground import FRAME, STEERING_KEY, mapping_text, steering
from tests.telemetry.ros2.test_gateway import Ground, S, state

STATE_OUT = """
[[out]]
topic = "/foretwin/state"
type = "nav_msgs/msg/Odometry"
source = "state"
"""
OBJECTS_OUT = """
[[out]]
topic = "/foretwin/objects"
type = "autoware_perception_msgs/msg/DetectedObjects"
source = "virtual_objects"
"""
PARKED = """
[[virtual]]
id = "parked"
kind = "car"
lat_deg = 52.5
lon_deg = 13.4
"""


@pytest.mark.parametrize(("ago_ms", "sent"), [(500.0, 1), (500.1, 0)])
def test_the_first_command_starts_from_an_angle_that_was_measured_lately(
    ago_ms: float, sent: int
) -> None:
    ground = Ground(enabled=True, flag=True)
    ground.arrive(STEERING_KEY + "RIHS01_x", steering(5 * S, 0.1))
    ground.step(ago_ms)
    ground.orders.say(ground.bus, Authority(sent_mono_ns=ground.now_ns))
    command = VehicleCommand(
        stamp_ns=0, sent_mono_ns=ground.now_ns, tire_angle_rad=0.2, accel_mps2=1.0, speed_mps=1.0
    )
    ground.orders.say(ground.bus, command)
    ground.step()
    assert len(ground.foreign.on("/control/cmd")) == sent
    report = ground.gateway.report()
    assert report["held"].get("/control/cmd", 0) == 1 - sent
    assert report["gate"].get("measured steering not known", 0) == 1 - sent


def test_states_go_out_fifty_times_a_second_at_most_and_diagnostics_once() -> None:
    ground = Ground(enabled=False, flag=False, more=STATE_OUT)
    for _ in range(200):
        ground.bus.publish("state", state(5 * S + ground.now_ns), vehicle="ego")
        ground.step(5.0)
    assert len(ground.foreign.on("/foretwin/state")) == 50
    assert len(ground.foreign.on("/foretwin/diagnostics")) == 1


def test_objects_of_the_mapping_go_out_ten_times_a_second() -> None:
    ground = Ground(enabled=False, flag=False, more=OBJECTS_OUT + PARKED)
    for _ in range(100):
        ground.bus.publish("state", state(5 * S + ground.now_ns), vehicle="ego")
        ground.step(10.0)
    assert len(ground.foreign.on("/foretwin/objects")) == 10


def test_a_stamp_that_no_ros_time_holds_is_counted_and_survived() -> None:
    ground = Ground(enabled=False, flag=False, more=STATE_OUT)
    ground.bus.publish("state", state(2**31 * S), vehicle="ego")
    ground.step()
    assert ground.foreign.on("/foretwin/state") == []
    assert ground.gateway.report()["held"]["/foretwin/state: error"] == 1
    ground.bus.publish("state", state(5 * S), vehicle="ego")
    ground.step(20.0)
    assert len(ground.foreign.on("/foretwin/state")) == 1


@pytest.mark.parametrize(
    ("placed", "frame_id", "north_m"), [(True, "map", 0.0), (False, "foretwin_drive", -111.26)]
)
def test_a_state_lies_in_the_map_where_the_mapping_places_it_else_in_the_drives_plane(
    placed: bool, frame_id: str, north_m: float
) -> None:
    """The drive's plane begins a thousandth of a degree north of the map."""
    text = mapping_text(enabled=False)
    mapping = parse_mapping(text, name="m.toml")
    if not placed:
        mapping = msgspec.structs.replace(mapping, map_place=None)
    drive_frame = LocalFrame(GeoPoint(52.501, 13.4))
    out = Outwards(mapping, drive_frame=drive_frame, vehicle_id="ego")
    odometry = typestore().deserialize_cdr(out.state(state(5 * S)), ODOMETRY)
    assert odometry.header.frame_id == frame_id
    assert odometry.pose.pose.position.y == pytest.approx(north_m, abs=0.1)
    clock = typestore().deserialize_cdr(out.clock(5 * S + 7), "rosgraph_msgs/msg/Clock")
    assert (clock.clock.sec, clock.clock.nanosec) == (5, 7)


@pytest.mark.parametrize(("alt_m", "z_m"), [(0.0, 0.0), (75.5, 1.5)])
@pytest.mark.parametrize("lot_alt_m", [None, 0.0, 74.0])
def test_who_has_no_altitude_stands_on_the_ground_of_a_map_that_has_one(
    alt_m: float, z_m: float, lot_alt_m: float | None
) -> None:
    """Virtual traffic and whoever is placed without `alt_m`; 0 is an altitude that is unknown."""
    text = mapping_text(enabled=True).replace("lon_deg = 13.4", "lon_deg = 13.4\nalt_m = 74.0", 1)
    anchor = None
    if lot_alt_m is not None:
        pose = AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0, alt_m=lot_alt_m)
        anchor = Anchor(lot=pose, world=pose)
    out = Outwards(
        parse_mapping(text, name="m.toml"), drive_frame=FRAME, vehicle_id="ego", anchor=anchor
    )
    placed = PlacedObject(user_id="p", kind="pedestrian", lat_deg=52.5, lon_deg=13.4, alt_m=alt_m)
    data = out.objects(RoadUsers(stamp_ns=5 * S, users=(placed.at(0.0),)), PREDICTED_OBJECTS)
    (told,) = typestore().deserialize_cdr(data, PREDICTED_OBJECTS).objects
    middle_m = told.kinematics.initial_pose_with_covariance.pose.position.z
    assert middle_m == pytest.approx(z_m + told.shape.dimensions.z / 2.0)


@pytest.mark.parametrize("kind", [CONTROL, ACKERMANN])
def test_a_command_goes_out_in_either_form(kind: str) -> None:
    mapping = parse_mapping(mapping_text(enabled=True), name="m.toml")
    out = Outwards(mapping, drive_frame=FRAME, vehicle_id="ego")
    command = VehicleCommand(
        stamp_ns=0, sent_mono_ns=1, tire_angle_rad=0.25, accel_mps2=-1.5, speed_mps=4.0
    )
    ros = typestore().deserialize_cdr(out.command(command, kind, stamp_ns=6 * S), kind)
    if kind == CONTROL:
        told = (
            ros.lateral.steering_tire_angle, ros.longitudinal.acceleration,
            ros.longitudinal.velocity, ros.stamp.sec,
        )  # fmt: skip
    else:
        told = (
            ros.drive.steering_angle, ros.drive.acceleration, ros.drive.speed, ros.header.stamp.sec,
        )  # fmt: skip
    # Ackermann's acceleration is a magnitude: braking is told by a speed below the car's.
    assert told == ((0.25, -1.5, 4.0, 6) if kind == CONTROL else (0.25, 1.5, 0.0, 6))
