"""Time to collision, encroachment, headway and required decelerations against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.metrics.encroachment import STOPPING_DECEL_MPS2
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Rollout
from tests.sim_worker.metrics.motions import LENGTH_M, VEHICLE, WIDTH_M, Mover, rollout, times

COVERS = (
    "foretwin.sim_worker.metrics.following",
    "foretwin.sim_worker.metrics.rollout",
    "foretwin.sim_worker.metrics.time_to_collision",
)

HALF_M = LENGTH_M / 2
speeds = st.floats(2.0, 25.0)
sizes = st.tuples(st.floats(0.5, 12.0), st.floats(0.4, 2.5))
yaws = st.floats(-math.pi, math.pi)


def value(driven: Rollout, name: str) -> float:
    return float(evaluate(driven, (name,))[name].values[0])


def values(driven: Rollout, *names: str) -> dict[str, float]:
    return {name: float(found.values[0]) for name, found in evaluate(driven, names).items()}


def turned(mover: Mover, yaw: float) -> Mover:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return mover._replace(
        x=cos * mover.x - sin * mover.y, y=sin * mover.x + cos * mover.y, yaw=mover.yaw + yaw
    )


@settings(max_examples=60)
@given(speeds, speeds, st.floats(20.0, 60.0), sizes, yaws)
def test_following_in_any_direction(
    speed: float, leader_mps: float, ahead: float, size: tuple[float, float], yaw: float
) -> None:
    ego, leader = Mover(0, 0, 0, speed), Mover(ahead, 0.3, 0, leader_mps, *size)
    driven = rollout(turned(ego, yaw), turned(leader, yaw), time_s=times(0.1))
    gap, closing = ahead - HALF_M - size[0] / 2, speed - leader_mps
    gaps = gap - closing * times(0.1)

    found = values(
        driven,
        "thw",
        "ttc",
        "drac",
        "required_deceleration",
        "required_lateral_acceleration",
        "required_acceleration",
    )

    assert found["thw"] == pytest.approx(gaps.min() / speed, abs=1e-6)
    if closing > 0.02:
        until = gaps.min() / closing
        brake, swerve = closing / (2 * until), 2 * ((WIDTH_M + size[1]) / 2 - 0.3) / until**2
        assert found["ttc"] == pytest.approx(until, rel=1e-6)
        assert found["drac"] == pytest.approx(brake, abs=1e-6)
        assert found["required_deceleration"] == pytest.approx(brake, abs=1e-6)
        assert found["required_lateral_acceleration"] == pytest.approx(swerve, rel=1e-6)
        assert found["required_acceleration"] == pytest.approx(math.hypot(brake, swerve), rel=1e-6)
    elif closing <= 0.0:
        assert found["drac"] == pytest.approx(0.0, abs=1e-6)
        assert found["ttc"] == math.inf


@pytest.mark.parametrize("closing", [0.0, 1e-40, 1e-16, 1e-9, 1e-3])
@pytest.mark.parametrize("speed", [0.0, 8.0])
@pytest.mark.parametrize("yaw", [0.0, 1.0])
def test_who_is_met_in_an_hour_is_never_met(closing: float, speed: float, yaw: float) -> None:
    """A car that stands still moves by 1e-40 m/s; speeds that are the same differ by rounding."""
    ego, leader = Mover(0, 0, 0, speed + closing), Mover(20.0, 0.3, 0, speed)
    driven = rollout(turned(ego, yaw), turned(leader, yaw), time_s=times(0.1))

    assert set(values(driven, "ttc", "ttb", "tts", "ttr").values()) == {math.inf}


@settings(max_examples=60)
@given(speeds, speeds, st.floats(15.0, 70.0), st.floats(15.0, 70.0), sizes, yaws)
def test_crossing_at_right_angles(
    speed: float,
    other_mps: float,
    away: float,
    other_away: float,
    size: tuple[float, float],
    yaw: float,
) -> None:
    ego, other = Mover(-away, 0, 0, speed), Mover(0, -other_away, math.pi / 2, other_mps, *size)
    time_s = times(60.0, 0.25)
    driven = rollout(turned(ego, yaw), turned(other, yaw), time_s=time_s)
    enters = (away - HALF_M - size[1] / 2) / speed
    leaves = (away + HALF_M + size[1] / 2) / speed
    comes = (other_away - size[0] / 2 - WIDTH_M / 2) / other_mps
    goes = (other_away + size[0] / 2 + WIDTH_M / 2) / other_mps
    assume(leaves < time_s[-1] and goes < time_s[-1])
    # Whole steps on the other's path: what is between two instants is not seen.
    assume(leaves - enters > 0.25 and goes - comes > 0.25)
    pet = max(comes - leaves, enters - goes, 0.0)

    found = evaluate(driven, ("pet", "ttc_series"))
    first = found["ttc_series"].values[0, 0]
    assert found["pet"].values == pytest.approx([pet], abs=1e-6)
    if pet > 0.0:
        assert first == math.inf
    else:
        assert first == pytest.approx(max(comes, enters), abs=1e-6)


@settings(max_examples=60)
@given(st.floats(-3.0, 3.0), yaws, speeds, sizes)
def test_time_to_collision_is_when_outlines_come_to_touch(
    aim: float, yaw: float, speed: float, size: tuple[float, float]
) -> None:
    """Whatever the angle: a standing ego, and who comes from 30 m away past its middle."""
    away = 30.0
    other = Mover(
        -away * math.cos(yaw) - aim * math.sin(yaw),
        -away * math.sin(yaw) + aim * math.cos(yaw),
        yaw,
        speed,
        *size,
    )
    found = evaluate(rollout(Mover(0, 0), other, time_s=times(0.1)), ("ttc_series",))
    ttc = found["ttc_series"].values[0, 0]
    ego = Rectangles(np.zeros(2), np.zeros(()), LENGTH_M, WIDTH_M)

    def apart(time_s: float) -> float:
        way = speed * time_s
        centre = np.array([other.x + way * math.cos(yaw), other.y + way * math.sin(yaw)])
        return float(clearance(ego, Rectangles(centre, np.asarray(yaw), *size)))

    if math.isfinite(ttc):
        assert apart(ttc) == pytest.approx(0.0, abs=1e-6)
        assert apart(ttc - 1e-3) > 0.0
    else:
        assert min(apart(t) for t in np.linspace(0.0, 60.0 / speed, 300)) > 0.0


@settings(max_examples=60)
@given(speeds, speeds, st.floats(0.4, 2.7), sizes, st.floats(15.0, 40.0))
def test_encroachment_at_any_angle(
    speed: float, other_mps: float, angle: float, size: tuple[float, float], away: float
) -> None:
    """A box is on a strip while its middle is no farther off than half of what both are across."""
    cos, sin = math.cos(angle), math.sin(angle)
    other = Mover(-20.0 * cos, -20.0 * sin, angle, other_mps, *size)
    time_s = times(60.0, 0.25)
    reach = LENGTH_M / 2 * abs(sin) + WIDTH_M / 2 * abs(cos) + size[1] / 2
    stays, begins = 2.0 * reach / (speed * abs(sin)), away - reach / abs(sin)
    assume(stays > 0.25 and begins > 0.0)
    assume(begins / speed + stays < time_s[-1] and 20.0 / other_mps < time_s[-1])

    found = evaluate(rollout(Mover(-away, 0, 0, speed), other, time_s=time_s), ("et", "psd"))

    assert found["et"].values == pytest.approx([stays], abs=1e-6)
    stop_m = speed**2 / (2.0 * STOPPING_DECEL_MPS2)
    assert found["psd"].values == pytest.approx([begins / stop_m], rel=1e-6)


def test_encroachment_that_does_not_end_has_no_time_and_no_way_left_is_no_share() -> None:
    stays = rollout(Mover(-12, 0, 0, 6), Mover(0, -9, math.pi / 2, 9), time_s=times(2.0))
    on_it = rollout(Mover(0, 0, 0, 6), Mover(0.5, -30, math.pi / 2, 9))
    apart = rollout(Mover(0, 0, 0, 10), Mover(10, 3, 0, 8))
    found = {k: evaluate(one, ("et", "psd")) for k, one in enumerate((stays, on_it, apart))}

    assert not found[0]["et"].valid[0]
    assert found[1]["et"].valid[0]
    assert found[1]["psd"].values[0] == 0.0
    assert not found[2]["et"].valid[0]
    assert found[2]["psd"].values[0] == math.inf


def test_who_comes_towards_or_crosses_is_no_leader() -> None:
    oncoming = rollout(Mover(0, 0, 0, 10), Mover(60, 0, math.pi, 10), time_s=times(1.0))
    crossing = rollout(Mover(0, 0, 0, 10), Mover(30, -2, math.pi / 2, 4), time_s=times(1.0))
    beside = rollout(Mover(0, 0, 0, 10), Mover(20, 3.2, 0, 5), time_s=times(1.0))
    behind = rollout(Mover(0, 0, 0, 10), Mover(-20, 0, 0, 15), time_s=times(1.0))

    for driven in (oncoming, crossing, beside, behind):
        assert value(driven, "thw") == math.inf
        assert value(driven, "drac") == 0.0


def test_a_leader_in_a_bend_is_found_along_the_bend() -> None:
    time_s, radius, speed = times(1.0), 30.0, 9.0
    angle = speed * time_s / radius
    base = np.column_stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), angle])
    driven = rollout(Mover(0, 0, 0, speed), Mover(0, 0, 0, speed), time_s=time_s)
    driven.states[0, :, :3] = base
    driven.states[0, :, 3:6] = (speed, 0.0, speed / radius)
    ahead = angle + 1.0
    driven.users[0, :, 0] = np.column_stack(
        [radius * np.sin(ahead), radius * (1 - np.cos(ahead)), ahead]
    )
    front = LENGTH_M - VEHICLE.rear_overhang_m.value

    assert value(driven, "thw") == pytest.approx((radius * 1.0 - front - 2.0) / speed, abs=1e-6)


@pytest.mark.parametrize("rate_radps", [1e-4, 0.4, -0.4])
def test_who_backs_is_led_by_who_stands_behind_it(rate_radps: float) -> None:
    """As the car that drives the same circle forwards, with its rear overhang for a front."""
    time_s, speed, ahead_m = times(0.5), 2.0, 6.0
    rear_m = VEHICLE.rear_overhang_m.value
    driven = rollout(Mover(0, 0, 0, 0), Mover(0, 0, 0, 0), Mover(8, 0, 0, 0), time_s=time_s)
    radius = speed / rate_radps
    angle = np.append(speed * time_s, ahead_m) / radius
    circle = np.column_stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), angle])
    driven.states[0, :, :3] = np.add(circle[:-1], (0.0, 0.0, math.pi))
    driven.states[0, :, 3:6] = (-speed, 0.0, rate_radps)
    driven.users[0, :, 0] = circle[-1]
    driven.users[0, :, 1] = (-8.0, 0.0, 0.0)

    gap_m = ahead_m - speed * time_s[-1] - rear_m - 2.0
    assert value(driven, "thw") == pytest.approx(gap_m / speed, abs=1e-6)
    assert value(driven, "drac") == pytest.approx(speed**2 / (2.0 * gap_m), abs=1e-6)


def test_exposure_counts_the_time_below_the_threshold() -> None:
    driven = rollout(
        Mover(0, 0, 0, 10), Mover(12 + HALF_M, 0, 0, 5, length=4), time_s=times(1.0, 0.01)
    )

    # The gap of 10 m lasts for 2 s: after half a second less than 1.5 s are left.
    assert value(driven, "ttc") == pytest.approx(1.0)
    assert value(driven, "time_exposed") == pytest.approx(0.5, abs=0.011)
    assert value(driven, "time_integrated") == pytest.approx(0.125, abs=0.006)


def test_ways_that_do_not_cross_have_no_encroachment() -> None:
    parallel = rollout(Mover(0, 0, 0, 10), Mover(10, 3, 0, 8))
    waits = rollout(Mover(0, 0, 0, 10), Mover(30, -8, math.pi / 2, 0))

    assert value(parallel, "pet") == math.inf
    assert value(waits, "pet") == math.inf
