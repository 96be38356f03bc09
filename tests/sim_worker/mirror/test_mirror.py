from __future__ import annotations

import itertools
import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.beside_road import Building
from foretwin.contracts.drive import ControlCommand, VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, target_from_source
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.simulation import MirrorSample
from foretwin.sim_worker.mirror.mirror import Mirror
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import altered
from tests.sim_worker.places import FRAME, box, crossroads, state_at

COVERS = ("foretwin.sim_worker.mirror.samples", "foretwin.sim_worker.mirror.track")
CAR = load_vehicle()


def _circle(
    *, hz: float = 50.0, until_s: float = 20.0, radius_m: float = 25.0
) -> list[VehicleState]:
    """A car on a circle whose speed goes up and down, measured without steering."""
    found = []
    for k in range(int(until_s * hz) + 1):
        t = k / hz
        speed = 8.0 + math.sin(0.5 * t)
        angle = (8.0 * t + 2.0 * (1 - math.cos(0.5 * t))) / radius_m
        found.append(
            state_at(
                -50.0 + radius_m * math.sin(angle),
                -1.5 + radius_m * (1 - math.cos(angle)),
                angle,
                speed,
                stamp_ns=round(t * 1e9) + 7_000_000_000,
                yaw_rate=speed / radius_m,
                tire_angle=None,
                accel=0.5 * math.cos(0.5 * t),
            )
        )
    return found


def _samples(mirror: Mirror, track: list[VehicleState]) -> list[MirrorSample]:
    return [sample for state in track if (sample := mirror.handle_state(state)) is not None]


def test_shadow_and_ghost_stand_at_the_measured_pose_at_every_sample() -> None:
    drive_frame = LocalFrame(GeoPoint(52.51, 13.38))
    mirror = Mirror(CAR, drive_frame=drive_frame)
    mirror.set_world(crossroads())
    track = _circle(until_s=10.0)
    samples = {sample.stamp_ns: sample for sample in _samples(mirror, track)}
    assert len(samples) == 101
    for k, state in enumerate(track):
        sample = samples.get(state.stamp_ns)
        if sample is None:
            continue
        t = k / 50.0
        angle = (8.0 * t + 2.0 * (1 - math.cos(0.5 * t))) / 25.0
        here = np.array([[-50 + 25 * math.sin(angle), -1.5 + 25 * (1 - math.cos(angle))]])
        there = target_from_source(drive_frame, FRAME, here, np.array([angle]))
        for pose in (sample.real, sample.shadow, sample.ghost):
            assert math.hypot(*(there.xy_m[0] - (pose.x_m, pose.y_m))) < 1e-3
            assert math.remainder(pose.yaw_rad - there.yaw_rad[0], math.tau) == pytest.approx(
                0.0, abs=1e-6
            )


def test_without_recorded_commands_the_twin_repeats_the_motion_and_says_so() -> None:
    mirror = Mirror(CAR, drive_frame=FRAME)
    samples = _samples(mirror, _circle())
    assert not any(sample.independent for sample in samples)
    assert max(sample.gap_m for sample in samples) < 2.0
    assert max(abs(sample.gap_speed_mps) for sample in samples) < 0.1
    for sample in samples[5:]:
        assert sample.twin_yaw_rate_radps == pytest.approx(sample.twin.speed_mps / 25.0, abs=0.03)


def test_the_gap_is_along_and_across_the_measured_heading() -> None:
    for sample in _samples(Mirror(CAR, drive_frame=FRAME), _circle()):
        real, twin = sample.real, sample.twin
        along = np.array([math.cos(real.yaw_rad), math.sin(real.yaw_rad)])
        gap = np.array([twin.x_m - real.x_m, twin.y_m - real.y_m])
        assert sample.gap_along_m == pytest.approx(gap @ along, abs=1e-6)
        assert sample.gap_across_m == pytest.approx(along[0] * gap[1] - along[1] * gap[0], abs=1e-6)


def test_where_a_map_moves_the_car_the_free_twins_gap_does_not_jump() -> None:
    track = _circle(until_s=4.0)
    found = []
    for moved_m in (0.0, 3.0):
        mirror = Mirror(CAR, drive_frame=FRAME)
        states_ = [
            msgspec.structs.replace(
                state,
                position=GeoPoint(
                    state.position.lat_deg + moved_m / 111_266.0, state.position.lon_deg
                ),
                map_shift_m=(0.0, moved_m) if moved_m else None,
            )
            if k > 100
            else state
            for k, state in enumerate(track)
        ]
        found.append([sample.gap_m for sample in _samples(mirror, states_)])

    np.testing.assert_allclose(found[0], found[1], atol=0.2)


@pytest.mark.parametrize("hz", [10.0, 50.0, 33.3])
def test_the_twin_starts_anew_every_window_and_not_between(hz: float) -> None:
    mirror = Mirror(CAR, drive_frame=FRAME, window_s=4.0)
    samples = _samples(mirror, _circle(hz=hz))
    pairs = list(itertools.pairwise(samples))
    assert sum(after.since_reset_s < before.since_reset_s for before, after in pairs) == 4
    for before, after in pairs:
        if after.since_reset_s > before.since_reset_s:
            moved = math.hypot(after.twin.x_m - before.twin.x_m, after.twin.y_m - before.twin.y_m)
            passed_s = (after.stamp_ns - before.stamp_ns) / 1e9
            assert moved == pytest.approx(before.twin.speed_mps * passed_s, abs=0.12)


@pytest.mark.parametrize(("first_std_rad", "anew"), [(0.15, 1), (0.071, 1), (0.069, 0), (None, 0)])
def test_a_twin_starts_anew_once_the_heading_is_known_that_it_started_without(
    first_std_rad: float | None, anew: int
) -> None:
    """For half a second the heading is 6 degrees off; 2 standard deviations may be 8 degrees."""
    track = _circle(until_s=6.0)
    wrong = [
        msgspec.structs.replace(one, yaw_rad=one.yaw_rad - 0.1, yaw_std_rad=first_std_rad)
        for one in track[:25]
    ]
    right = [msgspec.structs.replace(one, yaw_std_rad=0.03) for one in track[25:]]
    samples = _samples(Mirror(CAR, drive_frame=FRAME), wrong + right)

    alone = _samples(Mirror(CAR, drive_frame=FRAME), right)
    times = itertools.pairwise(samples)
    begins = [now for last, now in times if now.since_reset_s < last.since_reset_s]
    assert [(one.stamp_ns, one.gap_m) for one in begins] == [(right[0].stamp_ns, 0.0)] * anew
    assert (samples[-1].gap_m == pytest.approx(alone[-1].gap_m, abs=0.01)) == bool(anew)


def test_a_new_world_starts_the_twin_anew_at_its_stamp() -> None:
    mirror = Mirror(CAR, drive_frame=FRAME)
    mirror.set_world(crossroads(), from_stamp_ns=9_000_000_000)
    samples = _samples(mirror, _circle(until_s=4.0))
    assert [sample.world_id for sample in samples[:20]] == [None] * 20
    assert {sample.world_id for sample in samples[20:]} == {"crossroads"}
    first = samples[20]
    assert (first.since_reset_s, first.gap_m) == (0.0, 0.0)
    mirror.set_world(crossroads(), from_stamp_ns=0)
    after = _samples(mirror, _circle(until_s=5.0)[201:])
    assert after[-1].since_reset_s == pytest.approx(3.0, abs=0.01)


def test_a_free_twin_that_runs_into_a_post_starts_anew_and_it_is_told_once() -> None:
    """The car drives past the post at 7 m/s; its twin keeps straight on and drifts into it."""
    post = Building(
        id="post",
        outline=box(0.0, -3.0, 0.6, 0.6).outline,
        holes=(),
        height_m=Quantity(4.0, "default"),
    )
    world = msgspec.structs.replace(crossroads(), buildings=(post,))
    mirror = Mirror(CAR, drive_frame=FRAME, commands_recorded=True)
    mirror.set_world(world)
    samples = []
    for k in range(150):
        t = k / 50.0
        x, aside = 7.0 * t - 14.0, 1.5 * math.sin(min(t, 1.0) * math.pi / 2.0)
        state = state_at(x, -2.6 + aside, 0.0, 7.0, stamp_ns=round(t * 1e9) + 1)
        straight = ControlCommand(stamp_ns=state.stamp_ns, tire_angle_rad=0.0, accel_mps2=0.0)
        mirror.handle_command(straight)
        if sample := mirror.handle_state(state):
            samples.append(sample)
    told = [sample for sample in samples if sample.touches]
    assert [sample.touches for sample in told] == [(("ego", "world"),)]
    assert told[0].since_reset_s < 0.1
    assert max(sample.gap_m for sample in samples) < 2.0
    assert all(sample.twin.speed_mps == pytest.approx(7.0, abs=0.2) for sample in samples)


def test_the_twin_follows_recorded_commands_with_the_vehicles_ratio_offset_and_delay() -> None:
    car = altered(CAR, steering_delay_s=0.3, steering_offset_rad=0.01, steering_ratio=15.0)
    mirror = Mirror(car, drive_frame=FRAME, commands_recorded=True, window_s=60.0)
    turned_at_s, yaw_at = None, {}
    for k in range(151):
        t = k / 50.0
        wheel = 15.0 * ((0.1 if t >= 1.0 else 0.0) - 0.01)
        mirror.handle_command(
            ControlCommand(stamp_ns=round(t * 1e9), accel_mps2=0.0, steering_wheel_rad=wheel)
        )
        sample = mirror.handle_state(state_at(-50.0 + 8 * t, 0.0, stamp_ns=round(t * 1e9)))
        if sample is None:
            continue
        assert sample.independent
        yaw_at[round(t, 2)] = sample.twin.yaw_rad
        if turned_at_s is None and abs(sample.twin.yaw_rad) > 1e-3:
            turned_at_s = t
    # Straight until command and delay have passed, then δ = 0.1 at the tyres.
    assert turned_at_s == pytest.approx(1.4, abs=0.11)
    rate = (yaw_at[3.0] - yaw_at[2.5]) / 0.5
    assert rate == pytest.approx(8.0 * math.tan(0.1) / car.wheelbase_m.value, rel=0.03)


def test_a_reseeded_twin_remembers_the_commands_still_under_way() -> None:
    car = altered(CAR, steering_delay_s=0.4)
    mirror = Mirror(car, drive_frame=FRAME, commands_recorded=True, window_s=2.0)
    yaw_rates = []
    for k in range(301):
        t = k / 50.0
        mirror.handle_command(
            ControlCommand(stamp_ns=round(t * 1e9), accel_mps2=0.0, tire_angle_rad=0.1)
        )
        angle = 8.0 * math.tan(0.1) / car.wheelbase_m.value
        state = state_at(
            0.0, 0.0, angle * t, stamp_ns=round(t * 1e9), yaw_rate=angle, tire_angle=0.1
        )
        sample = mirror.handle_state(state)
        if sample is not None and t > 0.5:
            yaw_rates.append(sample.gap_yaw_rad)
    assert np.abs(yaw_rates).max() < 0.02


def test_estimated_or_missing_commands_are_not_independent() -> None:
    mirror = Mirror(CAR, drive_frame=FRAME, commands_recorded=True)
    first = mirror.handle_state(state_at(0.0, 0.0, stamp_ns=0))
    assert first is not None
    assert not first.independent
    guess = ControlCommand(stamp_ns=50, accel_mps2=0.0, tire_angle_rad=0.0, estimated=True)
    mirror.handle_command(guess)
    later = mirror.handle_state(state_at(0.8, 0.0, stamp_ns=100_000_000))
    assert later is not None
    assert not later.independent


@pytest.mark.parametrize("goes_on", [False, True], ids=["silent stack", "stack goes on"])
def test_what_a_human_does_is_no_gap_of_the_twin(goes_on: bool) -> None:
    """Commanded to keep 8 m/s; after 4 s a human brakes to a stop, whatever the stack says."""
    mirror = Mirror(CAR, drive_frame=FRAME, commands_recorded=True, window_s=8.0)
    x, speed, gaps = 0.0, 8.0, []
    for k in range(300):
        t = k / 50.0
        speed = max(speed - 0.06, 0.0) if t > 4.0 else speed
        x += speed / 50.0
        if t <= 4.0 or goes_on:
            push = ControlCommand(stamp_ns=round(t * 1e9), accel_mps2=0.15, tire_angle_rad=0.0)
            mirror.handle_command(push)
        mode = "manual" if t > 4.0 and goes_on else "unknown"
        state = state_at(x, 0.0, 0.0, speed, stamp_ns=round(t * 1e9))
        if sample := mirror.handle_state(msgspec.structs.replace(state, control_mode=mode)):
            gaps.append((t, sample.independent, sample.gap_speed_mps))
    assert all(told for t, told, _ in gaps if t <= 4.0)
    assert not any(told for t, told, _ in gaps if t > 4.6)
    drift_mps, most_mps = (max(abs(v) for t, _, v in gaps if t <= s) for s in (4.0, 6.0))
    assert most_mps - drift_mps < (0.1 if goes_on else 1.7)


def test_states_without_heading_or_out_of_order_are_passed_over() -> None:
    mirror = Mirror(CAR, drive_frame=FRAME)
    blind = msgspec.structs.replace(state_at(0.0, 0.0, stamp_ns=5), yaw_valid=False)
    assert mirror.handle_state(blind) is None
    assert mirror.handle_state(state_at(0.0, 0.0, stamp_ns=1_000_000_000)) is not None
    assert mirror.handle_state(state_at(0.0, 0.0, stamp_ns=900_000_000)) is None


def test_a_standing_car_has_a_standing_twin() -> None:
    mirror = Mirror(CAR, drive_frame=FRAME)
    track = [state_at(3.0, 4.0, 0.3, 0.0, stamp_ns=k * 20_000_000) for k in range(400)]
    samples = _samples(mirror, track)
    assert max(sample.gap_m for sample in samples) < 1e-3


def test_a_twin_goes_on_with_other_parameters_from_where_it_is() -> None:
    """A third of the ratio makes it turn three times as much; it does not jump there."""
    quick = altered(CAR, steering_ratio=16.0 / 3.0, wheelbase_m=2.9, cog_from_rear_axle_m=1.5)
    mirror = Mirror(CAR, drive_frame=FRAME, window_s=60.0, commands_recorded=True)
    samples = []
    for k in range(201):
        stamp_ns = k * 20_000_000
        if k == 100:
            mirror.use_vehicle(quick, from_stamp_ns=stamp_ns)
        mirror.handle_command(
            ControlCommand(stamp_ns=stamp_ns, accel_mps2=0.0, steering_wheel_rad=0.32)
        )
        state = state_at(-50 + 0.16 * k, -1.5, 0.0, 8.0, stamp_ns=stamp_ns)
        sample = mirror.handle_state(state)
        samples += [] if sample is None else [sample]
    way = np.array([(one.twin.x_m, one.twin.y_m, one.twin.yaw_rad) for one in samples])
    steps = np.diff(way, axis=0)
    moved = np.hypot(steps[:, 0], steps[:, 1])
    assert moved == pytest.approx(0.8, abs=0.03)
    before, after = steps[15:19, 2].mean(), steps[-4:, 2].mean()
    assert after / before == pytest.approx(3.0 * CAR.wheelbase_m.value / 2.9, rel=0.1)
    assert np.abs(np.diff(steps[:, 2])).max() < 0.8 * (after - before)
