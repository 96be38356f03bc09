"""The gateway merges: the car's own list comes in, and goes out with what is virtual beside it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import RoadUser, RoadUsers
from foretwin.contracts.frames import geo_pose
from foretwin.contracts.towards_vehicle import Authority
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.objects import FROM_USERS, ObjectSpread
from foretwin.telemetry.ros_messages.parts import typestore
from tests.telemetry.ros2.gateway_ground import FRAME
from tests.telemetry.ros2.test_gateway import Ground, state

COVERS = ("foretwin.telemetry.ros2.inwards",)

S = 10**9
KINDS = (parts.PREDICTED_OBJECTS, parts.TRACKED_OBJECTS, parts.DETECTED_OBJECTS)
MORE = """
[[in]]
topic = "/perception/real"
type = "{kind}"
channel = "objects"
[[out]]
topic = "/merged/objects"
type = "{kind}"
source = "merged_objects"
[merged]
hide_real = {hide_real}
"""
VAN, WALKER = "a" * 32, "b" * 32


def user(name: str, x_m: float, y_m: float, *, van: bool, virtual: bool) -> RoadUser:
    at = geo_pose(FRAME, x_m, y_m, math.pi / 2)
    length_m, width_m = (5.0, 2.0) if van else (0.55, 0.65)
    return RoadUser(
        user_id=name, kind="car" if van else "pedestrian", position=at.position,
        yaw_rad=at.yaw_rad, speed_mps=0.0, length_m=length_m, width_m=width_m, virtual=virtual,
    )  # fmt: skip


class Merging(Ground):
    """A gateway whose gate is open, that knows where its car is."""

    def __init__(self, kind: str = parts.PREDICTED_OBJECTS, *, hide_real: str = "false") -> None:
        super().__init__(enabled=True, flag=True, more=MORE.format(kind=kind, hide_real=hide_real))
        self.kind = kind
        self.objects = Mailbox(100)
        self.bus.subscribe("objects", self.objects, vehicle="ego")
        self.orders.say(self.bus, Authority(sent_mono_ns=self.now_ns))
        self.bus.publish("state", state(5 * S), vehicle="ego")
        self.step()

    def virtual(self, *users: RoadUser, stamp_ns: int = 5 * S) -> None:
        self.bus.publish("virtual_objects", RoadUsers(stamp_ns=stamp_ns, users=users), run="r")
        self.step()

    def sees(self, *users: RoadUser, stamp_ns: int = 5 * S) -> bytes:
        """Let the car's perception say whom it sees, and return what it said."""
        spread = ObjectSpread(position_m=0.7)
        ros = FROM_USERS[self.kind](RoadUsers(stamp_ns=stamp_ns, users=users), FRAME, spread)
        data = bytes(typestore().serialize_cdr(ros, self.kind))
        package, _, name = self.kind.split("/")
        key = f"0/perception/real/{package}::msg::dds_::{name}_/RIHS01_x"
        self.now_ns += 50_000_000
        self.orders.say(self.bus, Authority(sent_mono_ns=self.now_ns))
        self.arrive(key, data)
        return data

    def merged(self) -> Any:
        return typestore().deserialize_cdr(self.foreign.on("/merged/objects")[-1], self.kind)

    def heard(self) -> tuple[str, ...]:
        item = self.objects.take()
        assert item is not None
        return tuple(one.user_id for one in item.message().users)


@pytest.mark.parametrize("kind", KINDS)
def test_real_and_virtual_ones_are_one_list(kind: str) -> None:
    ground = Merging(kind)
    ground.virtual(user("ghost", 20.0, 8.0, van=False, virtual=True))
    data = ground.sees(user(VAN, 12.0, 0.0, van=True, virtual=False))
    merged, real = ground.merged(), typestore().deserialize_cdr(data, kind)
    assert len(merged.objects) == 2
    assert merged.header.stamp == real.header.stamp
    assert merged.header.frame_id == "map"
    # What the car said of its own object is there as it was, with its own covariance.
    assert typestore().serialize_cdr(
        type(merged)(merged.header, merged.objects[:1]), kind
    ) == typestore().serialize_cdr(real, kind)
    kinematics = merged.objects[1].kinematics
    pose = (
        kinematics.initial_pose_with_covariance
        if kind == parts.PREDICTED_OBJECTS
        else kinematics.pose_with_covariance
    )
    assert (pose.pose.position.x, pose.pose.position.y) == (
        pytest.approx(20.0, abs=1e-6),
        pytest.approx(8.0, abs=1e-6),
    )
    assert np.diag(pose.covariance.reshape(6, 6)).tolist() == pytest.approx(
        [0.01, 0.01, 0.0, 0.0, 0.0, 0.0025]
    )
    assert ground.gateway.report()["merged"] == {"added": 1}


def test_a_virtual_walker_behind_a_real_van_is_not_told() -> None:
    ground = Merging()
    ground.virtual(user("ghost", 16.0, 0.0, van=False, virtual=True))
    ground.sees(user(VAN, 12.0, 0.0, van=True, virtual=False))
    assert len(ground.merged().objects) == 1
    assert ground.gateway.report()["merged"] == {"not seen": 1}


def test_nothing_real_is_doubled_and_none_left_out() -> None:
    ground = Merging()
    ground.virtual(user("same", 12.2, 0.1, van=True, virtual=True))
    ground.sees(
        user(VAN, 12.0, 0.0, van=True, virtual=False),
        user(WALKER, 16.0, 0.0, van=False, virtual=False),
    )
    assert [bytes(one.object_id.uuid).hex() for one in ground.merged().objects] == [VAN, WALKER]
    assert ground.gateway.report()["merged"] == {"are real ones": 1}


def test_a_virtual_van_hides_a_real_walker_by_request_alone() -> None:
    for asked, told in (("false", 2), ("true", 1)):
        ground = Merging(hide_real=asked)
        ground.virtual(user("ghost", 12.0, 0.0, van=True, virtual=True))
        ground.sees(user(WALKER, 16.0, 0.0, van=False, virtual=False))
        assert len(ground.merged().objects) == told
        # What is hidden from the car's stack is not hidden from us.
        assert ground.heard() == (WALKER,)


def test_the_same_virtual_one_has_the_same_uuid_each_time() -> None:
    ground = Merging()
    seen = []
    for number in range(3):
        x_m = 20.0 + number
        ground.virtual(user("ghost", x_m, 8.0, van=False, virtual=True), stamp_ns=5 * S + number)
        ground.sees(stamp_ns=5 * S + number)
        seen.append(bytes(ground.merged().objects[0].object_id.uuid))
    assert len(set(seen)) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_what_comes_back_is_dropped_on_the_way_in_and_out(kind: str) -> None:
    """The stack takes the merged list and tells of all of it again."""
    ground = Merging(kind)
    ghost = user("ghost", 20.0, 8.0, van=False, virtual=True)
    van = user(VAN, 12.0, 0.0, van=True, virtual=False)
    ground.virtual(ghost)
    ground.sees(van)
    assert len(ground.heard()) == 1
    ground.sees(van, ghost)
    assert len(ground.heard()) == 1
    assert len(ground.merged().objects) == 2
    shown = "/perception/real: road users that we have shown it"
    assert ground.gateway.report()["unused"] == {shown: 1}


def test_where_perception_is_silent_nothing_is_said() -> None:
    ground = Merging()
    ground.virtual(user("ghost", 20.0, 8.0, van=False, virtual=True))
    assert ground.foreign.on("/merged/objects") == []


def test_where_the_car_is_not_known_its_own_list_is_passed_on() -> None:
    ground = Merging()
    ground.virtual(user("ghost", 20.0, 8.0, van=False, virtual=True))
    data = ground.sees(user(VAN, 12.0, 0.0, van=True, virtual=False), stamp_ns=7 * S)
    assert ground.foreign.on("/merged/objects") == [data]
    assert ground.gateway.report()["merged"] == {"not added without the car's place": 1}


def test_a_list_too_long_to_compare_is_passed_on() -> None:
    ground = Merging(parts.DETECTED_OBJECTS)
    ground.virtual(user("ghost", 20.0, 8.0, van=False, virtual=True))
    crowd = [user(str(i), -40.0 - i, 0.0, van=False, virtual=False) for i in range(513)]
    data = ground.sees(*crowd)
    assert ground.foreign.on("/merged/objects") == [data]
    assert ground.gateway.report()["merged"] == {"not added to a list too long": 1}


def test_a_gate_that_is_shut_lets_no_merged_list_out() -> None:
    ground = Merging()
    ground.step(151.0)
    ground.sees(user(VAN, 12.0, 0.0, van=True, virtual=False))
    assert ground.foreign.on("/merged/objects") == []
    assert ground.gateway.report()["held"]["/merged/objects"] == 1
    assert ground.heard() == (VAN,)
