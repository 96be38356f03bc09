"""Which of the two is wrong: injected faults are found, and what is right is left alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import ControlCommand, GnssFix, ImuSample, SpeedSample
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.gap import Verdict
from foretwin.sim_worker.analysis.gap.verdict import FaultDetector
from tests.sim_worker.analysis.gap.judging_faults import (
    IN_TIME_S,
    NAMES,
    culprit_of,
    drive_s,
    drive_with,
    excited_s,
    judged,
    verdicts_of,
    verdicts_on,
)
from tests.sim_worker.analysis.gap.real_drives import accused_in
from tests.sim_worker.driving import altered
from tests.sim_worker.faulty_standin import (
    CAR_FAULTS,
    DURATION_S,
    MODEL_FAULTS,
    Exit,
    drive_of,
    gyro_as,
    model_with,
    said_as,
)
from tests.telemetry.standin_drive import FRAME

SEED, END_S = 2, 12.0
"""Of the fast tests: one drive simulated once."""
FOUND = (
    "steering_read_in_degrees",
    "steering_commanded_in_degrees",
    "steering_sign",
    "offset_steering_sensor",
    "scaled_gyro",
    "offset_speed",
    "steering_ratio",
    "steering_delay",
    "friction",
    "drive_gain",
)


def judged_as(
    change: Exit, *, gnss_ends_ns: float = math.inf, end_s: float = END_S
) -> tuple[list[Verdict], str]:
    """Return what is said of a sound car whose samples leave it changed, and what stays open."""
    drive = drive_of(SEED, end_s=end_s).with_fault(change)
    kept = [one for one in drive.samples if one[0] != "gnss" or one[1].stamp_ns <= gnss_ends_ns]
    detector = FaultDetector(drive.info, model_with(None), frame=FRAME)
    return list(verdicts_on(detector, drive._replace(samples=kept))), detector.undecided


def speed_as(change: Callable[[float], float]) -> Exit:
    return said_as(SpeedSample, lambda m: {"speed_mps": change(m.speed_mps)})


def test_a_car_and_a_model_that_agree_are_left_alone() -> None:
    assert verdicts_of(None, seed=SEED, end_s=END_S) == []


@pytest.mark.parametrize("fault", FOUND)
def test_an_injected_fault_is_found_and_named(fault: str) -> None:
    (verdict,) = verdicts_of(fault, seed=SEED, end_s=END_S)
    assert verdict.culprit == culprit_of(fault)
    assert verdict.cause in NAMES[fault]
    assert verdict.evidence
    assert verdict.text
    assert 0.9 <= verdict.confidence <= 0.99  # of what accuses, not of what agrees
    assert excited_s(fault, verdict, seed=SEED, end_s=END_S) <= IN_TIME_S


@pytest.mark.parametrize(
    ("gain", "unit"),
    [
        (3.6, "sent in kilometres per hour?"),
        (1.0 / 3.6, "metres per second taken for kilometres per hour?"),
        (2.237, "sent in miles per hour?"),
        (0.447, "metres per second taken for miles per hour?"),
    ],
)
def test_a_speed_in_another_unit_is_the_sensors_and_no_pedals(gain: float, unit: str) -> None:
    """Commanded accelerations look as wrong as the speed: they wait for the positions."""
    told, _ = judged_as(speed_as(lambda speed_mps: gain * speed_mps))
    assert [f"{one.culprit} {one.cause}" for one in told] == ["vehicle speed_sensor"]
    assert unit in told[0].text
    assert drive_s(told[0]) < 4.0


def test_a_speed_known_to_be_wrong_accuses_nobody_else_where_positions_end() -> None:
    """All that is compared with it looks wrong: pedals, steering, the model's tyres."""
    ends_ns = drive_of(SEED, end_s=END_S).info.start_stamp_ns + 6_000_000_000
    told, undecided = judged_as(speed_as(lambda speed_mps: 1.6 * speed_mps), gnss_ends_ns=ends_ns)
    assert [one.cause for one in told] == ["speed_sensor"]
    assert undecided == ""


def test_a_speed_that_is_stuck_accuses_no_pedals_whenever_the_car_drives_as_fast() -> None:
    told, _ = judged_as(speed_as(lambda speed_mps: 5.0))
    assert {one.cause for one in told} == {"speed_sensor"}


@pytest.mark.parametrize("end_s", [END_S, pytest.param(DURATION_S, marks=pytest.mark.judge)])
def test_clocks_apart_accuse_nobody_or_are_named(end_s: float) -> None:
    """By 0.2 s of speeds or positions; a gyro that is stamped early is a model that lags."""
    for kind, late_s in ((SpeedSample, 0.2), (GnssFix, -0.2), (ImuSample, -0.1)):
        late_ns = round(1e9 * late_s)
        change = said_as(kind, lambda m, ns=late_ns: {"stamp_ns": m.stamp_ns + ns})
        told, _ = judged_as(change, end_s=end_s)
        assert len(told) == (kind is ImuSample)
        assert all("stamped by clocks" in one.text for one in told)


def test_a_gyro_in_degrees_per_second_is_the_gyros_and_no_models() -> None:
    """No model can begin where a car is said to turn by ten radians a second."""
    told, _ = judged_as(gyro_as(math.degrees(1.0), 0.0))
    assert {f"{one.culprit} {one.cause}" for one in told} == {"vehicle gyro_sensor"}


def test_a_gyro_that_turns_the_other_way_is_told_as_such() -> None:
    told, _ = judged_as(gyro_as(-1.0, 0.0))
    assert [f"{one.culprit} {one.cause}" for one in told] == ["vehicle gyro_sensor"]
    assert "(its sign is wrong?)" in told[0].text


@pytest.mark.parametrize("fault", ["weaker", "gyro"])
def test_a_fault_that_begins_while_driving_is_dated(fault: str) -> None:
    """The drive of a sound car goes over into that of one whose commands or gyro are off."""
    begin_ns = drive_of(SEED, end_s=END_S).info.start_stamp_ns + 8_000_000_000
    drive = drive_of(SEED, end_s=END_S)
    detector = FaultDetector(drive.info, model_with(None), frame=FRAME)
    told = []
    for channel, message in drive.samples:
        if message.stamp_ns >= begin_ns:
            if fault == "gyro" and isinstance(message, ImuSample):
                x, y, z = message.rate_radps
                message = msgspec.structs.replace(message, rate_radps=(x, y, z + 0.15))
            if fault == "weaker" and isinstance(message, ControlCommand):
                wheel = (message.steering_wheel_rad or 0.0) / 0.4
                message = msgspec.structs.replace(message, steering_wheel_rad=wheel)
        told.append(detector.handle(channel, message))
    (first, *_) = [verdict for verdict in told if verdict]
    assert first.culprit == "vehicle"
    assert first.cause == ("gyro_sensor" if fault == "gyro" else "steering_gain")
    assert abs(first.since_stamp_ns - begin_ns) < 1_000_000_000
    assert first.stamp_ns - begin_ns < 4_000_000_000


def test_without_commands_a_wrong_ratio_is_nobodys_but_degrees_are_the_cars() -> None:
    def told(fault: str) -> tuple[list[str], str]:
        drive = drive_with(fault, seed=SEED, end_s=END_S)
        detector = FaultDetector(
            drive.info, model_with(fault if fault in MODEL_FAULTS else None), frame=FRAME
        )
        verdicts = [detector.handle(*sample) for sample in drive.samples if sample[0] != "control"]
        said = [f"{verdict.culprit} {verdict.cause}" for verdict in verdicts if verdict]
        return said, detector.undecided

    accused, undecided = told("steering_ratio")
    assert accused == []
    assert "no commands are recorded" in undecided
    assert "the car's steering sensor or the model's steering ratio or wheelbase" in undecided
    assert "obeys its commands" not in undecided
    assert told("steering_read_in_degrees")[0][:1] == ["vehicle steering_in_degrees"]


def test_a_model_whose_steering_lags_as_the_cars_does_is_left_alone() -> None:
    """What was measured has the lag in it already: it must not act twice."""
    drive = drive_of(SEED, end_s=END_S)
    detector = FaultDetector(drive.info, altered(model_with(None), steering_lag_s=0.2), frame=FRAME)
    lags = []
    for sample in drive.samples[: round(0.75 * len(drive.samples))]:
        verdict = detector.handle(*sample)
        assert verdict is None or verdict.cause == "steering_delay"
        if detector.latest is not None and detector.latest.motion_lag is not None:
            lags.append(detector.latest.motion_lag.seconds)
    assert max(lags) <= 0.04


def test_late_lost_doubled_and_reordered_samples_accuse_nobody() -> None:
    """50 ms of jitter, a fifth lost, some twice, in the order of their coming."""
    drive = drive_of(SEED, end_s=END_S)
    random = np.random.default_rng(3)
    came = [
        (message.stamp_ns + round(random.exponential(5e7)), channel, message)
        for channel, message in drive.samples
        for _ in range(random.choice([0, 1, 2], p=[0.2, 0.75, 0.05]))
    ]
    came.sort(key=lambda one: one[0])
    detector = FaultDetector(drive.info, model_with(None), frame=FRAME)
    assert not any(detector.handle(channel, message) for _, channel, message in came)


def test_a_telephones_positions_accuse_no_sensor_and_confirm_none() -> None:
    drive = drive_of(SEED, end_s=END_S)
    undecided = []
    for fault in (None, "steering_ratio"):
        detector = FaultDetector(drive.info, model_with(fault), frame=FRAME)
        for channel, message in drive.samples:
            if isinstance(message, GnssFix):
                message = msgspec.structs.replace(message, std_m=3.0)
            assert detector.handle(channel, message) is None
        undecided.append(detector.undecided)
    assert undecided[0] == ""
    assert undecided[1].startswith("no precise positions confirm the gyro: ")
    assert "though the car obeys its commands" in undecided[1]


def test_no_verdict_without_excitation() -> None:
    """Creeping straight on under a wrong ratio shows nothing."""
    drive = drive_of(SEED, end_s=END_S)
    detector = FaultDetector(drive.info, model_with("steering_ratio"), frame=FRAME)
    start_ns = drive.info.start_stamp_ns
    quiet = [s for s in drive.samples if s[1].stamp_ns < start_ns + 3_000_000_000]
    assert not any(detector.handle(*sample) for sample in quiet)


def _dirty(samples: list[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
    """Yield a drive with NaN, jumps of 500 m and stamps that run back strewn in."""
    for index, (channel, message) in enumerate(samples):
        yield channel, message
        if index % 400 == 7:
            stamp_ns = message.stamp_ns
            yield "speed", SpeedSample(stamp_ns=stamp_ns + 1, speed_mps=float("nan"))
            bad = (float("nan"),) * 3
            yield "imu", ImuSample(stamp_ns=stamp_ns + 1, accel_mps2=bad, rate_radps=bad)
            yield "speed", SpeedSample(stamp_ns=stamp_ns - 60_000_000_000, speed_mps=3.0)
        if index % 1500 == 99 and channel == "imu":
            there = GeoPoint(FRAME.origin.lat_deg + 0.0045, FRAME.origin.lon_deg)
            yield "gnss", GnssFix(stamp_ns=message.stamp_ns + 3, position=there, std_m=0.02)


def test_dirty_samples_are_survived_and_accuse_nobody() -> None:
    drive = drive_of(SEED, end_s=END_S)
    detector = FaultDetector(drive.info, model_with(None), frame=FRAME)
    with np.errstate(invalid="raise"):
        told = [detector.handle(*sample) for sample in _dirty(drive.samples)]
    assert not any(told)
    detector.handle("speed", msgspec.UNSET)  # a message without a stamp is passed over


@pytest.mark.judge
@pytest.mark.timeout(3600)
def test_all_faults_and_seeds() -> None:
    """25 faults times 5 seeds: 95 % accuse the right one within 3 s of excitation."""
    cases = [
        judged(fault, seed=seed) for seed in range(1, 6) for fault in (*CAR_FAULTS, *MODEL_FAULTS)
    ]
    failed = [case for case in cases if not case.in_time]
    assert len(failed) <= 0.05 * len(cases), failed


@pytest.mark.judge
@pytest.mark.timeout(3600)
def test_an_hour_without_faults_raises_one_false_alarm_at_most() -> None:
    """113 drives of 32 s; each seed has another way."""
    told = [
        one for seed in range(100, 213) for one in verdicts_of(None, seed=seed, until_first=False)
    ]
    assert len(told) <= 1, told


@pytest.mark.judge
@pytest.mark.real_data
@pytest.mark.timeout(3600)
def test_real_drives_raise_one_false_alarm_at_most(data_dir: Path) -> None:
    """ "Undecided" is none: it says that nobody can be accused."""
    accused = [(name, one.cause) for name, _, said in accused_in(data_dir) for one in said]
    assert len(accused) <= 1, accused
