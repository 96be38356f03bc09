"""Several vehicles in one world: who meets whom, and what a change of role leaves as it was."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.drive import ControlCommand, ControlMode, VehicleState
from foretwin.contracts.roles import FollowLimits, Role
from foretwin.sim_worker.mirror.member import GroupMember, Member
from foretwin.sim_worker.mirror.track import MeasuredPose
from foretwin.sim_worker.mirror.vehicle_group import VehicleGroup
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import FRAME, box, crossroads, state_at

COVERS = ("foretwin.sim_worker.mirror.member",)

CAR, VAN = load_vehicle(), load_vehicle("vw_vanagon")
TICK_NS = 20_000_000
LIMITS = FollowLimits()


def pair(car: Role, van: Role) -> VehicleGroup:
    group = VehicleGroup(
        None, FRAME, (GroupMember("car", CAR), GroupMember("van", VAN)), limits=LIMITS
    )
    group.set_roles({"car": car, "van": van})
    return group


def meet(group: VehicleGroup, *, van_speed: float = 0.0, until_s: float = 6.0) -> VehicleGroup:
    """Let the car be measured driving at 8 m/s through where the van is measured, 25 m ahead."""
    for k in range(round(until_s * 50)):
        t = k / 50.0
        for name, state in (
            ("van", state_at(25.0 - van_speed * t, 0.0, 0.0, -van_speed, stamp_ns=k * TICK_NS)),
            ("car", state_at(8.0 * t, 0.0, stamp_ns=k * TICK_NS)),
        ):
            group.take_state(name, state)
        group.advance(k * TICK_NS)
    return group


def x_of(group: VehicleGroup, name: str) -> float:
    return float(group.members[name].twin().pose[0])


@pytest.mark.parametrize(
    ("car", "van", "touch"),
    [
        ("twin", "shadow", True),
        ("twin", "twin", True),
        ("all", "shadow", True),
        ("shadow", "shadow", True),
        ("shadow", "twin", True),
        ("twin", "ghost", False),
        ("ghost", "shadow", False),
        ("ghost", "twin", False),
        ("ghost", "ghost", False),
    ],
)
def test_who_meets_whom_is_a_matter_of_roles(car: Role, van: Role, touch: bool) -> None:
    group = meet(pair(car, van))
    assert group.touches == ({("car", "van")} if touch else set())
    if car in ("twin", "all"):
        # Where it meets the van, which nothing moves or only a push, it does not come by.
        assert (x_of(group, "car") > 40.0) != touch
    if (car, van) == ("shadow", "twin"):
        assert x_of(group, "van") > 26.0  # pushed along


def test_roles_may_change_until_just_before_and_count_at_once() -> None:
    group = meet(pair("twin", "ghost"), until_s=1.5)
    group.set_roles({"van": "shadow"})
    assert meet_on(group, 1.5, 6.0).touches == {("car", "van")}
    gone = meet(pair("twin", "shadow"), until_s=1.5)
    gone.set_roles({"van": "ghost"})
    assert meet_on(gone, 1.5, 6.0).touches == set()
    assert x_of(gone, "car") > 40.0


def meet_on(group: VehicleGroup, from_s: float, until_s: float) -> VehicleGroup:
    for k in range(round(from_s * 50), round(until_s * 50)):
        group.take_state("van", state_at(25.0, 0.0, 0.0, 0.0, stamp_ns=k * TICK_NS))
        group.take_state("car", state_at(8.0 * k / 50.0, 0.0, stamp_ns=k * TICK_NS))
        group.advance(k * TICK_NS)
    return group


@pytest.mark.parametrize("mode", ["autonomous", "manual"])
def test_commands_that_a_human_drives_over_move_no_twin(mode: ControlMode) -> None:
    group = VehicleGroup(None, FRAME, (GroupMember("van", VAN, commanded=True),), limits=LIMITS)
    group.set_roles({"van": "twin"})
    for k in range(150):
        ns = k * TICK_NS
        brake = ControlCommand(stamp_ns=ns, accel_mps2=-3.0, tire_angle_rad=0.0)
        group.take_command("van", brake)
        state = state_at(8.0 * k / 50.0, 0.0, stamp_ns=ns)
        group.take_state("van", msgspec.structs.replace(state, control_mode=mode))
        group.advance(ns)
    stood_back_m = 8.0 * 149 / 50.0 - x_of(group, "van")
    assert stood_back_m > 5.0 if mode == "autonomous" else abs(stood_back_m) < 0.3


def test_a_wall_stops_a_twin_and_is_named() -> None:
    world = crossroads(buildings=(box(20.0, 0.0, 3.0, 3.0),))
    group = VehicleGroup(world, FRAME, (GroupMember("car", CAR),), limits=LIMITS)
    group.set_roles({"car": "twin"})
    group.correction = "follow"
    for k in range(200):
        group.take_state("car", state_at(8.0 * k / 50.0, 0.0, stamp_ns=k * TICK_NS))
        group.advance(k * TICK_NS)
    assert group.touches == {("car", "world")}
    # The correction does not push it on through what physics stops it at.
    nose_m = x_of(group, "car") + CAR.length_m.value - CAR.rear_overhang_m.value
    assert nose_m < 17.0 + 0.3


def test_who_is_not_measured_any_more_is_gone_and_comes_back() -> None:
    group = meet(pair("twin", "shadow"), until_s=1.0)
    for k in range(50, 300):
        group.take_state("car", state_at(8.0 * k / 50.0, 0.0, stamp_ns=k * TICK_NS))
        group.advance(k * TICK_NS)
    assert not group.members["van"].present
    assert group.touches == set()
    group.take_state("van", state_at(60.0, 0.0, 0.0, 0.0, stamp_ns=300 * TICK_NS))
    group.take_state("car", state_at(48.0, 0.0, stamp_ns=300 * TICK_NS))
    group.advance(300 * TICK_NS)
    assert group.members["van"].present


def weaving(k: int, *, side_m: float = 0.0) -> VehicleState:
    """A car in an S of 0.1 Hz at about 10 m/s; its model drives the same line elsewhere."""
    t = k / 50.0
    yaw = 0.25 * math.sin(0.6 * t)
    x = 10.0 * t
    y = -(2.5 / 0.6) * (math.cos(0.6 * t) - 1.0) + side_m
    return state_at(
        x, y, yaw, 10.0, stamp_ns=k * TICK_NS, yaw_rate=0.15 * math.cos(0.6 * t), tire_angle=None
    )


def shown(member: Member, stamp_ns: int) -> MeasuredPose:
    """Where a vehicle is in its role, and how it moves."""
    return member.twin() if member.has_twin else member.box(member.track.at(stamp_ns))


SINGLE: list[Role] = ["twin", "shadow", "ghost"]


@settings(max_examples=8, deadline=None)
@given(
    roles=st.lists(st.sampled_from(SINGLE), min_size=2, max_size=4),
    gap_m=st.tuples(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5)),
    follow=st.booleans(),
)
def test_a_change_of_role_keeps_pose_and_speed(
    roles: list[Role], gap_m: tuple[float, float], follow: bool
) -> None:
    group = VehicleGroup(None, FRAME, (GroupMember("car", CAR),), limits=LIMITS)
    group.set_roles({"car": "twin"})
    group.correction = "follow" if follow else "free"
    member = group.members["car"]
    k = 0
    for number, role in enumerate(["twin", *roles]):
        for _ in range(40):
            group.take_state("car", weaving(k))
            group.advance(k * TICK_NS)
            k += 1
        if number == 0:
            member.body.nudge(np.array([*gap_m, 0.03]))
        stamp_ns = group.stamp_ns
        assert stamp_ns is not None
        before = shown(member, stamp_ns)
        group.set_roles({"car": role})
        after = shown(member, stamp_ns)
        assert after.pose == pytest.approx(before.pose, abs=1e-9)
        assert after.rate == pytest.approx(before.rate, abs=1e-9)


def test_a_shadow_that_was_a_twin_drifts_to_its_vehicle_within_the_limits() -> None:
    group = VehicleGroup(None, FRAME, (GroupMember("car", CAR),), limits=LIMITS)
    group.set_roles({"car": "twin"})
    member = group.members["car"]
    offsets = []
    for k in range(1200):
        group.take_state("car", weaving(k))
        group.advance(k * TICK_NS)
        if k == 50:
            member.body.nudge(np.array([1.0, -1.0, 0.05]))
            group.set_roles({"car": "shadow"})
        if k > 50:
            offsets.append([*member.offset, *member.settling.acceleration])
    course = np.array(offsets)
    assert np.abs(course[0, :3]) == pytest.approx([1.0, 1.0, 0.05], abs=0.1)
    assert not course[-1].any()
    assert np.abs(course[:, 3:5]).max() <= 1.0
    assert np.abs(course[:, 5]).max() <= 0.3
