"""A twin that follows: drawn to its vehicle without a jump, and its gap is not hidden."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from foretwin.contracts.drive import ControlCommand
from foretwin.contracts.roles import Correction, FollowLimits, UseRoles
from foretwin.contracts.simulation import MirrorSample
from foretwin.sim_worker.mirror.member import GroupMember
from foretwin.sim_worker.mirror.mirror import Mirror
from foretwin.sim_worker.mirror.vehicle_group import VehicleGroup
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered
from tests.sim_worker.mirror.test_vehicle_group import TICK_NS, weaving
from tests.sim_worker.places import FRAME, crossroads, state_at

COVERS = ("foretwin.sim_worker.mirror.role_manager", "foretwin.sim_worker.mirror.samples")

CAR = load_vehicle()
LIMITS = FollowLimits()
TICKS = 820


@settings(max_examples=4, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(
    along=st.floats(-3.0, 3.0),
    across=st.floats(-2.0, 2.0),
    yaw=st.sampled_from([0.0, 0.1]),
    speed=st.sampled_from([0.0, 3.0, 12.0]),
)
def test_a_gap_closes_within_the_bounds_and_without_overshoot(
    along: float, across: float, yaw: float, speed: float
) -> None:
    group = VehicleGroup(None, FRAME, (GroupMember("car", CAR),), limits=LIMITS)
    group.set_roles({"car": "twin"})
    group.correction = "follow"
    member = group.members["car"]
    gaps, accels = [], []
    for k in range(650):
        group.take_state("car", state_at(speed * k / 50.0, 0.0, 0.0, speed, stamp_ns=k * TICK_NS))
        group.advance(k * TICK_NS)
        if k == 5:
            member.body.nudge(np.array([along, across, yaw]))
        if k >= 5:
            there = member.track.at(k * TICK_NS)
            gaps.append(there.pose - member.twin().pose)
            accels.append(member.drawn.acceleration)
    left, drawn = np.array(gaps), np.array(accels)
    size = max(math.hypot(along, across), 0.1)
    assert np.hypot(left[-1, 0], left[-1, 1]) < 0.02 * size + 0.02
    # Turned away, a twin that drives leaves its lane before it is back: no constant gap.
    for axis, start in ((0, along), (1, across)) if yaw == 0.0 else ():
        overshoot = (left[:, axis] * math.copysign(1.0, start)).max()
        assert overshoot < 0.05 * size + 0.02
    for axis, accel, jerk in ((0, 1.0, 2.0), (1, 1.0, 2.0), (2, 0.3, 0.6)):
        assert np.abs(drawn[:, axis]).max() <= accel
        assert np.abs(np.diff(drawn[:, axis])).max() <= jerk * TICK_NS / 1e9 + 1e-9


def drive(
    mirror: Mirror, *, wrong_gain: float, changes: dict[int, str], ticks: int = 600
) -> list[MirrorSample]:
    """A car that weaves, told a little more acceleration than it takes; `changes` by tick."""
    samples = []
    for k in range(ticks):
        if k in changes:
            mirror.set_roles(
                UseRoles(stamp_ns=k * TICK_NS, roles={}, correction=changes[k])  # type: ignore[arg-type]
            )
        state = weaving(k)
        steer = math.atan(CAR.wheelbase_m.value * state.yaw_rate_radps / 10.0)
        command = ControlCommand(
            stamp_ns=k * TICK_NS, accel_mps2=0.18 + wrong_gain, tire_angle_rad=1.04 * steer
        )
        mirror.handle_command(command)
        sample = mirror.handle_state(state)
        if sample is not None:
            samples.append(sample)
    return samples


def _mirror() -> Mirror:
    car = altered(CAR, steering_delay_s=0.0)
    return Mirror(car, drive_frame=FRAME, commands_recorded=True, rate_hz=50.0)


def _jumps(samples: list[MirrorSample]) -> np.ndarray:
    """How far the twin is at each sample from where its motion led it, in m and m/s."""
    rows = np.array([[s.twin.x_m, s.twin.y_m, s.twin.yaw_rad, s.twin.speed_mps] for s in samples])
    half = 0.5 * (rows[1:, 2:] + rows[:-1, 2:])
    led = rows[:-1, :2] + 0.02 * half[:, 1:] * np.column_stack(
        [np.cos(half[:, 0]), np.sin(half[:, 0])]
    )
    away = np.hypot(*(rows[1:, :2] - led).T)
    return np.column_stack([away, np.abs(np.diff(rows[:, 3]))])


def test_a_following_twin_does_not_jump_where_a_free_one_does_and_stays_nearer() -> None:
    free = drive(_mirror(), wrong_gain=0.1, changes={})
    follow = drive(_mirror(), wrong_gain=0.1, changes={100: "follow"})
    assert _jumps(free)[:, 0].max() > 0.5
    assert _jumps(follow[101:])[:, 0].max() < 0.03
    assert _jumps(follow[101:])[:, 1].max() < 0.05
    # Figures are those of the free twin, to the bit: no correction hides what the model does.
    for name in ("gap_m", "gap_along_m", "gap_across_m", "gap_yaw_rad", "since_reset_s"):
        assert [getattr(s, name) for s in free] == [getattr(s, name) for s in follow]
    assert follow[-1].free == free[-1].twin
    shown_m = [math.hypot(s.twin.x_m - s.real.x_m, s.twin.y_m - s.real.y_m) for s in follow]
    assert np.mean(shown_m[300:]) < 0.5 * np.mean([s.gap_m for s in follow[300:]])


def test_switching_on_and_off_keeps_position_and_speed() -> None:
    on, off = 230, 500
    samples = drive(_mirror(), wrong_gain=0.1, changes={on: "follow", off: "free"}, ticks=TICKS)
    jumps = _jumps(samples)
    # Free again, it goes on from where it is until the next window's end.
    since_s = [sample.since_reset_s for sample in samples]
    until = next(k for k in range(off, TICKS) if since_s[k + 1] < since_s[k])
    assert until > off + 20
    assert jumps[on - 20 : until, 0].max() < 0.03
    assert jumps[on - 20 : until, 1].max() < 0.05
    assert samples[on + 50].correction is not None
    assert samples[-1].correction is None


def test_without_anything_asked_for_there_is_no_cast() -> None:
    sample = _mirror().handle_state(weaving(0))
    assert sample is not None
    assert (sample.role, sample.free, sample.correction) == ("all", None, None)


@pytest.mark.parametrize(("correction", "shown"), [("follow", True), ("free", False)])
def test_a_correction_of_nothing_is_shown_while_following_alone(
    correction: Correction, shown: bool
) -> None:
    mirror = _mirror()
    mirror.set_roles(UseRoles(stamp_ns=0, roles={"ego": "twin"}, correction=correction))
    samples = drive(mirror, wrong_gain=0.1, changes={}, ticks=50)
    assert (samples[-1].correction is not None) == shown


def test_a_new_world_does_not_move_a_following_twin() -> None:
    mirror = _mirror()
    mirror.set_roles(UseRoles(stamp_ns=0, roles={}, correction="follow"))
    mirror.set_world(crossroads(), from_stamp_ns=300 * TICK_NS)
    samples = drive(mirror, wrong_gain=0.1, changes={}, ticks=450)
    assert {s.world_id for s in samples} == {None, "crossroads"}
    assert _jumps(samples)[:, 0].max() < 0.03


def test_a_twin_takes_no_parameters_that_no_vehicle_has() -> None:
    with pytest.raises(ValueError, match=r"steering_delay_s -1\.4 is implausible"):
        _mirror().use_vehicle(altered(CAR, steering_delay_s=-1.4))


def test_other_parameters_do_not_move_a_following_twin() -> None:
    mirror = _mirror()
    mirror.set_roles(UseRoles(stamp_ns=0, roles={}, correction="follow"))
    other = altered(CAR, drive_gain=0.9, wheelbase_m=2.7, cog_from_rear_axle_m=1.3)
    mirror.use_vehicle(other, from_stamp_ns=300 * TICK_NS)
    samples = drive(mirror, wrong_gain=0.1, changes={}, ticks=450)
    assert _jumps(samples)[:, 0].max() < 0.03


def test_a_twin_that_is_lost_starts_anew() -> None:
    group = VehicleGroup(None, FRAME, (GroupMember("car", CAR),), limits=LIMITS)
    group.set_roles({"car": "twin"})
    group.correction = "follow"
    for k in range(100):
        jumped = 0.0 if k < 50 else 30.0
        state = state_at(8.0 * k / 50.0 + jumped, 0.0, stamp_ns=k * TICK_NS)
        group.take_state("car", state)
        group.advance(k * TICK_NS)
    assert group.members["car"].twin().pose[0] == pytest.approx(8.0 * 99 / 50 + 30.0, abs=0.5)


def test_a_clock_that_steps_back_lets_everything_begin_anew() -> None:
    mirror = _mirror()
    mirror.set_roles(UseRoles(stamp_ns=0, roles={"ego": "twin"}, correction="follow"))
    samples = []
    for k in [*range(1000, 1030), *range(100, 130)]:
        state = weaving(k)
        sample = mirror.handle_state(state)
        assert sample is not None
        samples.append(sample)
    after = samples[30:]
    assert [s.stamp_ns for s in after] == [k * TICK_NS for k in range(100, 130)]
    assert {s.role for s in after} == {"twin"}
    away_m = [math.hypot(s.twin.x_m - s.real.x_m, s.twin.y_m - s.real.y_m) for s in after]
    assert max(away_m) < 0.5
