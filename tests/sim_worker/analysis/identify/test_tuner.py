"""Identification while driving: what counts when, by hand, pinned, rolled back, after a step."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import ImuSample, SteeringSample
from foretwin.contracts.errors import UserError
from foretwin.contracts.tuning import Identification
from foretwin.sim_worker.analysis.identify.tuner import Tuner
from foretwin.sim_worker.analysis.identify.window import UNDERSTEER_NAME, identify
from foretwin.sim_worker.vehicle.parameters import load_vehicle, understeer_gradient
from foretwin.telemetry.standin.parameters import read_parameters
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.sim_worker.analysis.identify.coverage import own_gradient, random_path
from tests.sim_worker.standin_drives import (
    estimate,
    recorded,
    samples_of,
    straight_minute,
)
from tests.telemetry.city_drive import city_drive
from tests.telemetry.known_standin import KnownStandin
from tests.telemetry.standin_drive import FRAME

COVERS = ("foretwin.sim_worker.analysis.identify.steering_signals",)

CAR = read_parameters().car
Sample = tuple[str, Any]


def tuner() -> Tuner:
    return Tuner(vehicle=load_vehicle(), vehicle_id="standin", frame=FRAME)


def through(taken: Tuner, samples: list[Sample]) -> list[Identification]:
    """Return every identification, each one taken as it comes."""
    told = []
    for channel, message in samples:
        found = taken.handle(channel, message)
        if found is not None:
            told.append(found)
            taken.take(found)
    return told


def test_parameters_count_as_soon_as_the_driving_tells_them() -> None:
    taken = tuner()
    told = through(taken, city_drive().samples)
    assert [round((found.stamp_ns - START_STAMP_NS) * 1e-9) for found in told] == [
        20,
        30,
        40,
        50,
        60,
        70,
    ]
    assert taken.vehicle.steering_ratio.value == pytest.approx(15.3, rel=0.02)
    assert taken.vehicle.brake_gain.value == pytest.approx(1.06, rel=0.03)
    assert taken.vehicle.steering_delay_s.value == pytest.approx(0.1, abs=0.01)
    assert taken.vehicle.wheelbase_m == load_vehicle().wheelbase_m
    assert not any(found.step_noticed for found in told)


def test_the_same_samples_give_the_same_parameters() -> None:
    first, second = tuner(), tuner()
    samples = city_drive().samples[:9000]
    through(first, samples)
    through(second, samples)
    assert first.vehicle == second.vehicle


def test_a_steering_ratio_that_changes_is_noticed_and_identified_anew() -> None:
    """As after a repair: the same drive twice, the second time with another steering wheel."""
    once = city_drive().samples
    lasts_ns = once[-1][1].stamp_ns - START_STAMP_NS + 10_000_000
    later: list[Sample] = []
    for channel, message in once:
        moved = msgspec.structs.replace(message, stamp_ns=message.stamp_ns + lasts_ns)
        if isinstance(moved, SteeringSample):
            assert moved.steering_wheel_rad is not None
            wheel = moved.steering_wheel_rad * 18.0 / 15.3
            moved = msgspec.structs.replace(moved, steering_wheel_rad=wheel)
        later.append((channel, moved))
    taken = tuner()
    told = through(taken, once + later)
    noticed = [found for found in told if "steering_ratio" in found.step_noticed]
    assert noticed
    assert noticed[0].stamp_ns > START_STAMP_NS + lasts_ns
    assert "just changed" in estimate(noticed[0], "steering_ratio").reason
    assert taken.vehicle.steering_ratio.value == pytest.approx(18.0, rel=0.02)


def _later(samples: list[Sample], lasts_ns: int) -> list[Sample]:
    return [
        (channel, msgspec.structs.replace(message, stamp_ns=message.stamp_ns + lasts_ns))
        for channel, message in samples
    ]


def _bends_s(samples: list[Sample], from_ns: int, until_ns: int) -> float:
    """Return for how long the car turned between two stamps, by its gyro at 100 Hz."""
    return 0.01 * sum(
        isinstance(message, ImuSample)
        and from_ns < message.stamp_ns <= until_ns
        and abs(message.accel_mps2[1]) > 0.5
        for _, message in samples
    )


def test_softer_front_tyres_are_noticed_in_seconds_of_bends_and_identified_anew() -> None:
    """The town twice, the second time with understeer of 0.003 rad/(m/s²), and over hills."""
    once = city_drive().samples
    change_ns = once[-1][1].stamp_ns + 10_000_000
    samples = once + _later(
        city_drive(compliance=0.003, hill_m=3.0).samples, change_ns - START_STAMP_NS
    )
    taken = tuner()
    told = through(taken, samples)
    noticed = [found for found in told if found.step_noticed]
    assert len(noticed) == 1
    assert noticed[0].step_noticed.startswith(UNDERSTEER_NAME)
    assert noticed[0].from_stamp_ns > change_ns
    assert "just changed" in estimate(noticed[0], UNDERSTEER_NAME).reason
    assert _bends_s(samples, change_ns, noticed[0].stamp_ns) < 6.0
    after = [found for found in told if found.stamp_ns > noticed[0].stamp_ns]
    # Nothing of the car before is in it: none of what is taken lies between the two.
    for found in after:
        assert found.from_stamp_ns > change_ns
    assert understeer_gradient(taken.vehicle) == pytest.approx(0.003, rel=0.15)


def test_a_car_that_understeers_on_hills_is_told_from_the_bundled_one() -> None:
    """Hills of up to 6 % are in the altitude; a column that gives is understeer."""
    drive = city_drive(compliance=0.003, hill_m=3.0)
    told = identify(recorded(drive.samples), load_vehicle(), vehicle_id="standin")
    assert estimate(told, UNDERSTEER_NAME).value == pytest.approx(0.003, rel=0.10)
    assert estimate(told, "steering_ratio").value == pytest.approx(CAR.steering_ratio, rel=0.02)
    assert estimate(told, "drive_gain").value == pytest.approx(CAR.drive_gain, rel=0.05)
    assert estimate(told, "brake_gain").value == pytest.approx(CAR.brake_gain, rel=0.05)


@pytest.mark.judge
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_tyres_changed_in_mid_drive_are_noticed_and_identified_anew(seed: int) -> None:
    softer, change_s, end_s = 0.0017, 70.0, 150.0
    random = np.random.default_rng(1000 + seed)
    parameters = read_parameters()
    path = random_path(random, parameters, length_m=1500.0)
    source = KnownStandin(path, parameters, vehicle_id="standin", seed=seed, end_s=end_s)
    change_ns = START_STAMP_NS + round(change_s * 1e9)
    samples = list(source.advance(change_ns))
    source.change_tyres(softness_rad_per_mps2=softer)
    samples += source.advance(START_STAMP_NS + round(end_s * 1e9))
    taken = tuner()
    told = through(taken, samples)
    noticed = [found for found in told if found.step_noticed]
    assert noticed
    assert noticed[0].stamp_ns > change_ns
    assert _bends_s(samples, change_ns, noticed[0].stamp_ns) < 8.0
    truth = own_gradient() + softer
    assert understeer_gradient(taken.vehicle) == pytest.approx(truth, abs=0.0005)


@pytest.mark.judge
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_tyres_softer_on_both_axles_in_mid_drive_are_noticed(seed: int) -> None:
    parameters = read_parameters()
    path = random_path(np.random.default_rng(1000 + seed), parameters, length_m=1500.0)
    source = KnownStandin(path, parameters, vehicle_id="standin", seed=seed, end_s=110.0)
    change_ns = START_STAMP_NS + 70_000_000_000
    samples = list(source.advance(change_ns))
    source.change_tyres(stiffness=0.7)
    samples += source.advance(START_STAMP_NS + 110_000_000_000)
    noticed = [found for found in through(tuner(), samples) if found.step_noticed]
    assert noticed
    assert "tyres' stiffness" in noticed[0].step_noticed
    assert noticed[0].stamp_ns > change_ns
    assert _bends_s(samples, change_ns, noticed[0].stamp_ns) < 12.0


def test_a_straight_motorway_changes_no_parameter() -> None:
    recorded, taken = straight_minute(), tuner()
    told = through(taken, samples_of(recorded))
    assert told
    assert taken.vehicle == load_vehicle()


def test_what_is_set_by_hand_stays_until_it_is_unpinned() -> None:
    taken = tuner()
    change = taken.set("steering_ratio", 17.0, stamp_ns=5)
    assert (change.before, change.value, change.origin, change.pinned) == (16.0, 17.0, "set", True)
    samples = city_drive().samples
    through(taken, samples[:9000])
    assert taken.vehicle.steering_ratio.value == 17.0
    taken.unpin("steering_ratio")
    through(taken, samples[9000:])
    assert taken.vehicle.steering_ratio.value == pytest.approx(15.3, rel=0.02)
    back = taken.rollback("steering_ratio", stamp_ns=9)
    assert back.origin == "rolled_back"
    assert taken.vehicle.steering_ratio.value != back.before
    assert "steering_ratio" in taken.pinned


def test_rolling_back_twice_reaches_the_file() -> None:
    taken = tuner()
    taken.set("mass_kg", 1200.0, stamp_ns=1)
    taken.set("mass_kg", 1300.0, stamp_ns=2)
    assert taken.rollback("mass_kg", stamp_ns=3).value == 1200.0
    assert taken.rollback("mass_kg", stamp_ns=4).value == load_vehicle().mass_kg.value
    with pytest.raises(UserError, match="nothing to roll back to"):
        taken.rollback("mass_kg", stamp_ns=5)


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("steering_wheel", 1.0, "no parameter of a vehicle"),
        ("name", 1.0, "no parameter of a vehicle"),
        ("mass_kg", -1.0, "implausible; it must be"),
        ("understeer_gradient_rad_per_mps2", 0.001, "follows from the stiffnesses"),
    ],
)
def test_what_cannot_be_set_is_said(name: str, value: float, told: str) -> None:
    taken = tuner()
    with pytest.raises(UserError, match=told):
        taken.set(name, value, stamp_ns=1)
    assert taken.vehicle == load_vehicle()
