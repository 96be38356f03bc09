"""The verdict on two cars is the same as of who sees both at one place."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_pose
from foretwin.contracts.roles import VehicleEncounter
from foretwin.orchestrator.other_vehicles.encounters import EncounterWatch
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.other_vehicles.two_cars import Drive, co_located, drawn

CAR, VAN = load_vehicle(None), load_vehicle("vw_vanagon")
FRAME = LocalFrame(GeoPoint(52.5, 13.4))
EAST = Drive(at_s=4.0, yaw_rad=0.0, speed_mps=8.0, curvature_pm=0.0, swing_mps=0.0)


def states(name: str, drive: Drive, *, every_s: float, first_s: float = 0.0) -> list[VehicleState]:
    """What is measured of it, without error, until second 8."""
    time_s = np.arange(first_s, 8.0, every_s)
    found = []
    rows = zip(time_s, drive.poses(time_s), drive.speeds(time_s), drive.accels(time_s), strict=True)
    for at_s, pose, speed_mps, accel_mps2 in rows:
        there = geo_pose(FRAME, *pose.tolist())
        found.append(
            VehicleState(
                vehicle_id=name, stamp_ns=round(at_s * 1e9), position=there.position,
                yaw_rad=there.yaw_rad, speed_mps=float(speed_mps), accel_mps2=float(accel_mps2),
                yaw_rate_radps=drive.curvature_pm * float(speed_mps),
            )
        )  # fmt: skip
    return found


def judged(
    own: Iterable[VehicleState],
    other: list[VehicleState],
    *,
    late_s: float = 0.0,
    clock_std_s: float = 0.0,
) -> list[VehicleEncounter]:
    """The encounters, where the other's states come `late_s` after their stamps."""
    watch = EncounterWatch({"ego": CAR, "van": VAN}, FRAME)
    waiting, ended = list(other), list[VehicleEncounter]()
    for state in own:
        while waiting and waiting[0].stamp_ns + late_s * 1e9 <= state.stamp_ns:
            watch.take(waiting.pop(0), clock_std_s=clock_std_s)
        watch.take(state)
        ended += watch.judge(state.stamp_ns)
    return ended + watch.finish()


@pytest.mark.judge
def test_a_hundred_encounters_are_judged_as_if_both_were_at_one_place() -> None:
    random = np.random.default_rng(19)
    touched = 0
    for _ in range(100):
        a, b = drawn(random)
        truth = co_located(CAR, a, VAN, b)
        found = judged(
            states("ego", a, every_s=0.02), states("van", b, every_s=0.1, first_s=0.013),
            late_s=0.08,
        )  # fmt: skip
        if truth.least_m > 10.0:
            assert not found
            continue
        (one,) = found
        assert one.touched == truth.touched, (a, b)
        assert one.least_m == pytest.approx(truth.least_m, abs=0.06)
        touched += one.touched
    assert 25 <= touched <= 75  # of both kinds there are many


def test_two_on_parallel_lanes_are_as_far_apart_as_their_sides() -> None:
    against = EAST._replace(yaw_rad=np.pi, aside_m=-3.5)
    (one,) = judged(states("ego", EAST, every_s=0.02), states("van", against, every_s=0.02))
    sides_m = (CAR.width_m.value + VAN.width_m.value) / 2.0
    assert one.least_m == pytest.approx(3.5 - sides_m, abs=0.01)
    assert (one.one, one.other, one.touched) == ("ego", "van", False)
    assert one.stamp_ns < one.least_stamp_ns < one.end_stamp_ns
    # They begin 10 m apart and end 20 m apart, and close and part at 16 m/s.
    assert (one.end_stamp_ns - one.stamp_ns) / 1e9 == pytest.approx((10 + 20 + 9.2) / 16, abs=0.2)


def test_how_sure_a_distance_is_says_position_clock_and_reckoning() -> None:
    against = EAST._replace(yaw_rad=np.pi, aside_m=-3.5)
    theirs = states("van", against, every_s=0.02)
    (one,) = judged(states("ego", EAST, every_s=0.02), theirs, clock_std_s=0.05)
    assert one.uncertain_m == pytest.approx(0.4, abs=0.01)  # 8 m/s for 50 ms
    silent = [state for state in theirs if state.stamp_ns < 3_400_000_000]
    (reckoned,) = judged(states("ego", EAST, every_s=0.02), silent)
    assert reckoned.least_m == pytest.approx(one.least_m, abs=0.01)
    assert 0.1 < reckoned.uncertain_m < 1.0


def test_who_falls_silent_is_gone_once_nobody_knows_where_it_is() -> None:
    crossing = EAST._replace(yaw_rad=np.pi / 2)
    theirs = states("van", crossing, every_s=0.02)
    gone = [state for state in theirs if state.stamp_ns < 2_800_000_000]
    (one,) = judged(states("ego", EAST, every_s=0.02), gone)
    assert not one.touched  # they would have, half a second after it was known where it was
    assert one.end_stamp_ns == pytest.approx(3_230_000_000, abs=50_000_000)
    # And the hole in between is not bridged where it comes back.
    back = gone + [state for state in theirs if state.stamp_ns > 5_000_000_000]
    assert not any(one.touched for one in judged(states("ego", EAST, every_s=0.02), back))


def test_a_short_hole_is_bridged() -> None:
    crossing = EAST._replace(yaw_rad=np.pi / 2)
    theirs = [
        state
        for state in states("van", crossing, every_s=0.02)
        if not 3_500_000_000 < state.stamp_ns < 3_800_000_000
    ]
    (one,) = judged(states("ego", EAST, every_s=0.02), theirs)
    assert one.touched


def test_a_turn_through_the_back_is_no_spin() -> None:
    # Yaw goes from just below pi to just above it; between two states it must not turn around.
    west = Drive(at_s=4.0, yaw_rad=np.pi, speed_mps=8.0, curvature_pm=0.02, swing_mps=0.0)
    beside = west._replace(aside_m=3.0)
    truth = co_located(CAR, west, VAN, beside)
    (one,) = judged(states("ego", west, every_s=0.1), states("van", beside, every_s=0.1))
    assert one.least_m == pytest.approx(truth.least_m, abs=0.02)


def test_ghosts_meet_nobody() -> None:
    watch = EncounterWatch({"ego": CAR, "van": VAN}, FRAME)
    for name in ("ego", "van"):
        for state in states(name, EAST, every_s=0.1):
            watch.take(state)
    assert watch.judge(8_000_000_000, apart=["van"]) == []
    assert watch.open == ()
    assert watch.judge(8_000_000_000) == []
    (open_one,) = watch.open
    assert open_one.touched
    assert watch.judge(8_000_000_000, apart=["van"]) == [open_one]
