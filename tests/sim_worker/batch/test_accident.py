from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUserKind
from foretwin.geometry.rectangles import Rectangles, separations
from foretwin.sim_worker.batch.accident import Accidents, run_accidents
from foretwin.sim_worker.batch.accident_bodies import accident_bodies
from foretwin.sim_worker.batch.accident_model import ContactLaw
from foretwin.sim_worker.batch.collision_detection import Touches, ego_rectangles, first_touches
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import cog_from_base
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS
from tests.sim_worker.rigid_impact import Body, impact

COVERS = ("foretwin.sim_worker.batch.accident_bodies", "foretwin.sim_worker.batch.accident_model")

CAR = load_vehicle()
TICK_S = 0.05


class Meeting(NamedTuple):
    """An ego that drives east from the origin, and where the other is when it sets out."""

    ego_mps: float
    x_m: float
    y_m: float
    yaw_rad: float
    user_mps: float
    kind: RoadUserKind = "car"


MEETINGS = {
    "head-on": Meeting(10.0, 30.0, 0.0, np.pi, 10.0),
    "rear-end": Meeting(15.0, 20.0, 0.0, 0.0, 5.0),
    "into a parked lorry": Meeting(10.0, 20.0, 0.0, 0.0, 0.0, "lorry"),
    "oblique": Meeting(10.0, 20.0, 0.3, 0.5, 0.0),
    "side, with rotation": Meeting(12.0, 20.0, -1.0, 1.75, 0.0),
}


def scene(meeting: Meeting, time_s: Array) -> tuple[Array, Array, Array]:
    """States (1, T, 8), the other's poses (1, T, 1, 3) and its size (1, 1, 2)."""
    states, users = np.zeros((1, len(time_s), 8)), np.zeros((1, len(time_s), 1, 3))
    states[0, :, 0], states[0, :, 3] = meeting.ego_mps * time_s, meeting.ego_mps
    way = np.array([np.cos(meeting.yaw_rad), np.sin(meeting.yaw_rad)])
    users[0, :, 0, :2] = (meeting.x_m, meeting.y_m) + meeting.user_mps * time_s[:, None] * way
    users[0, :, 0, 2] = meeting.yaw_rad
    size = np.array([[[KINDS[meeting.kind].length_m, KINDS[meeting.kind].width_m]]])
    return states, users, size


def touches(*meetings: Meeting) -> Touches:
    scenes = [scene(meeting, TICK_S * np.arange(80)) for meeting in meetings]
    states, users, size = (np.concatenate(parts) for parts in zip(*scenes, strict=True))
    found = first_touches(CAR, states, users, size, tick_s=TICK_S)
    assert len(found.time_s) == len(meetings)
    return found


def bodies(touch: Touches, meeting: Meeting) -> tuple[Body, Body]:
    described = accident_bodies(CAR, touch, kinds=[meeting.kind], friction_factor=np.ones(1))
    positions, velocities = cog_from_base(CAR, touch.ego_states)
    ego, other = (
        Body(mass, inertia, place[:2], motion[:3])
        for mass, inertia, place, motion in zip(
            described.mass_kg[:, 0], described.yaw_inertia_kgm2[:, 0],
            (positions[0], touch.user_poses[0]), (velocities[0], touch.user_velocities[0]),
            strict=True,
        )
    )  # fmt: skip
    return ego, other


def velocities(accidents: Accidents) -> tuple[Array, Array]:
    """Velocities (N, 3) of both centres of gravity in the first accident."""
    return cog_from_base(CAR, accidents.ego_states[0])[1][:, :3], accidents.user_velocities[0]


@pytest.mark.parametrize("name", MEETINGS)
@pytest.mark.parametrize(
    "material", [ContactLaw(0.1, 0.5), ContactLaw(0.3, 0.1), ContactLaw(0.5, 0.3)]
)
def test_velocities_after_an_impact_are_those_of_the_closed_form(
    name: str, material: ContactLaw
) -> None:
    meeting = MEETINGS[name]
    touch = touches(meeting)
    after = run_accidents(
        CAR, touch, kinds=[meeting.kind], impact=material, ground=False,
        duration_s=0.02, step_s=0.02,
    )  # fmt: skip
    ego, other = bodies(touch, meeting)
    wanted = impact(
        ego, other, point_m=touch.point_m[0], normal=touch.normal[0],
        restitution=material.restitution, friction=material.friction,
    )  # fmt: skip
    for body, motion, right in zip((ego, other), velocities(after), wanted, strict=True):
        change = np.hypot(*(right - body.velocity)[:2])
        assert motion[-1, :2] == pytest.approx(right[:2], abs=0.01 * change)
        assert motion[-1, 2] == pytest.approx(right[2], abs=0.02 * max(abs(right[2]), 0.2))
    assert after.ego_delta_v_mps[0] == pytest.approx((velocities(after)[0][-1] - ego.velocity)[:2])


@pytest.mark.parametrize("name", MEETINGS)
def test_momentum_is_conserved_and_energy_is_not_won(name: str) -> None:
    meeting = MEETINGS[name]
    touch = touches(meeting)
    after = run_accidents(CAR, touch, kinds=[meeting.kind], ground=False, step_s=0.01)
    ego, other = bodies(touch, meeting)
    centres = (cog_from_base(CAR, after.ego_states[0])[0][:, :2], after.user_poses[0, :, :2])
    momentum, spin, energy = np.zeros((101, 2)), np.zeros(101), np.zeros(101)
    for body, centre, motion in zip((ego, other), centres, velocities(after), strict=True):
        push = body.mass_kg * motion[:, :2]
        momentum += push
        spin += centre[:, 0] * push[:, 1] - centre[:, 1] * push[:, 0]
        spin += body.yaw_inertia_kgm2 * motion[:, 2]
        energy += (push * motion[:, :2]).sum(axis=1) / 2
        energy += body.yaw_inertia_kgm2 * motion[:, 2] ** 2 / 2
    before = ego.mass_kg * meeting.ego_mps
    assert momentum == pytest.approx(np.repeat(momentum[:1], 101, axis=0), abs=1e-6 * before)
    assert spin == pytest.approx(np.full(101, spin[0]), abs=1e-4 * before)
    assert (energy <= energy[0] * 1.001).all()
    assert energy[-1] < energy[0]


def test_two_cars_meet_head_on_and_the_record_says_so() -> None:
    meeting = MEETINGS["head-on"]
    after = run_accidents(CAR, touches(meeting), kinds=["car"])
    assert abs(after.angle_rad[0]) == pytest.approx(np.pi)
    assert after.closing_mps[0] == pytest.approx(20.0)
    # Each loses what the centre of gravity of both cars and a restitution of 0.1 ask for.
    total = CAR.mass_kg.value + 1500.0
    assert after.ego_delta_v_mps[0, 0] == pytest.approx(-1.1 * 20 * 1500 / total, rel=0.01)
    assert after.user_delta_v_mps[0, 0] == pytest.approx(
        1.1 * 20 * CAR.mass_kg.value / total, rel=0.01
    )
    assert after.after_time_s == pytest.approx(np.arange(21) * 0.05)
    assert after.valid.all()


def test_tyres_and_bodies_on_the_road_stop_what_slides() -> None:
    touch = touches(Meeting(10.0, 20.0, 0.2, np.pi / 2, 0.0, "pedestrian"))
    touch.ego_states[:, 7] = -8.0
    after = run_accidents(CAR, touch, kinds=["pedestrian"], duration_s=4.0)
    speed = np.hypot(*after.user_velocities[0, :, :2].T)
    assert speed.max() > 9.5
    # Sliding on asphalt: 0.66 g, whatever the way it is turned.
    decel = -np.diff(speed[4:24]) / 0.05
    assert decel.mean() == pytest.approx(0.66 * 9.81, rel=0.1)
    assert speed[-1] < 0.1
    # The car hardly notices.
    assert np.hypot(*after.ego_delta_v_mps[0]) < 0.8


def test_a_car_hit_in_its_side_turns_until_its_tyres_hold_it() -> None:
    meeting = MEETINGS["side, with rotation"]
    free, held = (
        run_accidents(CAR, touches(meeting), kinds=["car"], ground=ground, duration_s=2.0)
        for ground in (False, True)
    )
    assert abs(held.user_poses[0, -1, 2] - meeting.yaw_rad) > 0.3
    assert abs(held.user_velocities[0, -1, 2]) < 0.3 * abs(free.user_velocities[0, -1, 2])
    # The road changes little of the impact itself.
    assert held.user_delta_v_mps[0] == pytest.approx(free.user_delta_v_mps[0], rel=0.1, abs=0.2)


def test_a_braking_ego_goes_on_braking() -> None:
    touch = touches(MEETINGS["rear-end"])
    states = touch.ego_states.copy()
    states[:, 7] = -6.0
    rolling, braking = (
        run_accidents(CAR, touch._replace(ego_states=s), kinds=["car"], impact=ContactLaw(0.3, 0.5))
        for s in (touch.ego_states, states)
    )
    lost = rolling.ego_states[0, -1, 3] - braking.ego_states[0, -1, 3]
    assert lost == pytest.approx(6.0, abs=0.5)


def test_accidents_beside_each_other_are_those_alone() -> None:
    kinds: list[RoadUserKind] = [meeting.kind for meeting in MEETINGS.values()]
    together = run_accidents(CAR, touches(*MEETINGS.values()), kinds=kinds)
    for row, meeting in enumerate(MEETINGS.values()):
        alone = run_accidents(CAR, touches(meeting), kinds=[meeting.kind])
        assert np.array_equal(together.ego_states[row], alone.ego_states[0])
        assert np.array_equal(together.user_poses[row], alone.user_poses[0])


def test_no_touch_gives_no_accident_and_an_overlap_from_the_start_no_impact() -> None:
    touch = touches(MEETINGS["head-on"], MEETINGS["rear-end"])
    inside = touch._replace(from_start=np.array([True, False]))
    after = run_accidents(CAR, inside, kinds=["car", "car"])
    assert after.valid.tolist() == [False, True]
    assert np.isnan(after.ego_delta_v_mps[0]).all()
    assert np.isnan(after.closing_mps[0])
    none = run_accidents(CAR, Touches(*(part[:0] for part in touch)), kinds=[])
    assert none.ego_states.shape == (0, 21, 8)


def test_a_kind_for_each_touch_is_asked_for() -> None:
    with pytest.raises(ValueError, match="2 kinds of road users for 1 touches"):
        run_accidents(CAR, touches(MEETINGS["head-on"]), kinds=["car", "car"])


def test_a_restitution_that_no_contact_has_is_refused() -> None:
    with pytest.raises(ValueError, match=r"restitution 0\.0 must be within"):
        run_accidents(CAR, touches(MEETINGS["head-on"]), kinds=["car"], impact=ContactLaw(0.0))


def test_a_duration_that_is_no_whole_number_of_steps_is_refused() -> None:
    with pytest.raises(ValueError, match=r"duration_s 1 must be a multiple of step_s 0\.3"):
        run_accidents(CAR, touches(MEETINGS["head-on"]), kinds=["car"], step_s=0.3)


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.5, 25.0), st.floats(10.0, 20.0), st.floats(-1.0, 1.0), st.floats(-3.1, 3.1),
    st.floats(0.0, 15.0), st.sampled_from(list(KINDS)),
)  # fmt: skip
def test_whoever_meets_they_part_without_lying_in_each_other(
    ego_mps: float, x: float, y: float, yaw: float, user_mps: float, kind: RoadUserKind
) -> None:
    time_s = TICK_S * np.arange(80)
    # Whoever it is comes to x, y after a second.
    back = user_mps * np.array([np.cos(yaw), np.sin(yaw)])
    meeting = Meeting(ego_mps, x - back[0], y - back[1], yaw, user_mps, kind)
    states, users, size = scene(meeting, time_s)
    touch = first_touches(CAR, states, users, size, tick_s=TICK_S)
    assume(len(touch.time_s) == 1 and not touch.from_start[0])
    after = run_accidents(CAR, touch, kinds=[kind], step_s=0.02)
    assert after.valid.all()
    assert after.closing_mps[0] > -1e-6
    poses = after.user_poses[0]
    gap = separations(
        ego_rectangles(CAR, after.ego_states[0]),
        Rectangles(poses[:, :2], poses[:, 2], *touch.user_size_m[0]),
    )
    assert gap.max(axis=0).min() > -0.1
    # What one wins the other loses, and nobody is pushed harder than the two can.
    push = CAR.mass_kg.value * after.ego_delta_v_mps[0]
    assert KINDS[kind].mass_kg * after.user_delta_v_mps[0] == pytest.approx(-push, abs=1e-6)
    assert np.hypot(*after.ego_delta_v_mps[0]) < 1.2 * (ego_mps + user_mps)
