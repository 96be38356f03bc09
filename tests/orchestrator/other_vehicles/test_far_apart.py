"""Two cars on lots far apart, with clocks and links of their own, are judged as if co-located."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import encode
from foretwin.contracts.drive import ControlCommand, GnssFix, SpeedSample, VehicleState
from foretwin.contracts.frames import geo_pose
from foretwin.contracts.keys import CHANNELS, key
from foretwin.contracts.mailbox import Received
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.orchestrator.other_vehicles.live import LiveVehicle
from foretwin.orchestrator.other_vehicles.vehicle_clock import VehicleClock
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.other_vehicles.far_link import (
    BEGINS_S,
    FRAME,
    FarCar,
    Judged,
    Link,
    judged,
    lot,
)
from tests.orchestrator.other_vehicles.two_cars import Drive, Met, co_located, drawn

CAR, VAN = load_vehicle(None), load_vehicle("vw_vanagon")
HERE, THERE = lot(48.1, 11.6, 30.0), lot(51.0, 13.8, -110.0)
NEAR, FAR = Link(0.005, 0.005, 0.0), Link(0.08, 0.02, 0.05)
WITHIN_M = 0.2
"""What a least distance may be off: who passes nearer, or touches no deeper, is judged either
way, and is drawn anew."""


def met(a: Drive, b: Drive, folder: Path, *, seed: int, own: Link = FAR, **options: bool) -> Judged:
    first = FarCar("ego", a, CAR, HERE, own, ahead_s=0.0, fast_ppm=-10.0)
    second = FarCar("van", b, VAN, THERE, FAR, ahead_s=1.0, fast_ppm=20.0)
    return judged(first, second, folder=folder, seed=seed, **options)


def clear_cases(count: int, *, seed: int) -> list[tuple[Drive, Drive, Met]]:
    """Draw encounters, of both kinds, that are none of a hair's breadth."""
    random = np.random.default_rng(seed)
    cases = []
    while len(cases) < count:
        a, b = drawn(random)
        if co_located(CAR, a, VAN, b, from_s=BEGINS_S, to_s=0.0).least_m < 20.0:
            continue  # they met before, while estimators and clocks settled
        truth = co_located(CAR, a, VAN, b)
        grown = co_located(CAR, a, narrower(VAN, WITHIN_M), b)
        if truth.least_m < 9.0 and (truth.least_m > WITHIN_M or grown.touched):
            cases.append((a, b, truth))
    return cases


def narrower(vehicle: VehicleParameters, by_m: float) -> VehicleParameters:
    return msgspec.structs.replace(
        vehicle,
        length_m=Parameter(vehicle.length_m.value - 2 * by_m),
        rear_overhang_m=Parameter(vehicle.rear_overhang_m.value - by_m),
        width_m=Parameter(vehicle.width_m.value - 2 * by_m),
    )


def check(found: Judged, truth: Met) -> float:
    (one,) = found.encounters
    assert one.touched == truth.touched
    error_m = abs(one.least_m - truth.least_m)
    assert error_m <= WITHIN_M
    return error_m


def test_some_encounters_far_apart_are_judged_as_if_co_located(tmp_path: Path) -> None:
    for seed, (a, b, truth) in enumerate(clear_cases(4, seed=1)):
        found = met(a, b, tmp_path / str(seed), seed=seed)
        check(found, truth)
        clock = found.clocks["van"]
        assert clock["behind_car_s"] == pytest.approx(-1.0, abs=0.012)
        assert clock["how"] == "asked"


@pytest.mark.judge
@pytest.mark.timeout(900)
@pytest.mark.parametrize("own", [NEAR, FAR], ids=["car_near", "both_far"])
def test_a_hundred_encounters_far_apart_are_judged_as_if_co_located(
    tmp_path: Path, own: Link
) -> None:
    cases = clear_cases(100, seed=19)
    errors = [
        check(met(a, b, tmp_path / str(seed), seed=seed, own=own), truth)
        for seed, (a, b, truth) in enumerate(cases)
    ]
    touched = sum(truth.touched for *_, truth in cases)
    print(f"100 encounters, {touched} touches: worst {max(errors):.3f} m")
    assert 25 <= touched <= 75


def test_a_vehicle_that_does_not_say_the_time_is_judged_by_its_samples_and_said_to_be_unsure(
    tmp_path: Path,
) -> None:
    ((a, b, truth),) = clear_cases(1, seed=3)
    found = met(a, b, tmp_path, seed=0, answers=False)
    # Both links have the same least delay, which is what cannot be known.
    check(found, truth)
    assert found.clocks["van"]["how"] == "one way"
    assert found.clocks["van"]["std_s"] == pytest.approx(0.07, abs=0.001)


def test_what_a_far_vehicle_was_told_is_in_the_cars_time_as_its_states_are() -> None:
    ahead_ns = 1_000_000_000
    own = VehicleClock()
    own.answered(0, 0, 0)
    far = LiveVehicle(
        "van", VAN, ask_info=lambda _: None, tell=lambda _: None, own_clock=lambda: own.reading(0)
    )
    far.clock.answered(0, 0, ahead_ns)
    for k in range(30):
        ns = ahead_ns + k * 100_000_000
        there = geo_pose(FRAME, float(k), 0.0, 0.0)
        for channel, message in (
            ("control", ControlCommand(stamp_ns=ns, accel_mps2=0.0, tire_angle_rad=0.0)),
            ("speed", SpeedSample(stamp_ns=ns, speed_mps=10.0)),
            ("gnss", GnssFix(stamp_ns=ns, position=there.position)),
        ):
            sent = encode(message)
            item = Received(channel, key(channel, vehicle="van"), sent, CHANNELS[channel].kind)
            item.received_mono_ns = ns - ahead_ns
            far.take(item)
    state = VehicleState(
        vehicle_id="ego", stamp_ns=0, position=there.position, yaw_rad=0.0, speed_mps=0.0,
        yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip
    heard = far.states_until(state)
    told = [command.stamp_ns for one in heard for command in one.commands]
    assert heard[-1].state.stamp_ns == 2_900_000_000
    assert told[0] == 0
    assert max(told) == 2_900_000_000
