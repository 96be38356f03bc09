"""The gap while driving, and of a model that is compared with itself."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.contracts.drive import (
    ControlCommand,
    ControlMode,
    GnssFix,
    ImuSample,
    SpeedSample,
    VehicleState,
    VehicleStatus,
)
from foretwin.contracts.frames import GeoPoint, geo_from_local
from foretwin.contracts.gap import GapAlarm, GapSample, Verdict
from foretwin.sim_worker.analysis.gap.errors import GapMeter, gap_table
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner
from foretwin.sim_worker.analysis.gap.measured_motion import MeasuredMotion, motion_on_grid
from foretwin.sim_worker.analysis.gap.monitor import GapMonitor
from foretwin.sim_worker.analysis.gap.verdict import without_manual_commands
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord, MotionRecorder
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.sim_worker.analysis.gap.test_verdict import END_S, SEED
from tests.sim_worker.faulty_standin import drive_of, model_with
from tests.telemetry.standin_drive import FRAME

COVERS = ("foretwin.sim_worker.analysis.gap.errors",)

START_NS = 1_767_225_600_000_000_000


class OwnDrive(NamedTuple):
    """A drive whose "real" motion is the model's own under known commands."""

    recorder: MotionRecorder
    states: list[VehicleState]
    runner: FreeRunner

    def until(self, end_s: float) -> tuple[MotionRecord, MeasuredMotion]:
        """What is known of it by then."""
        record = self.recorder.record(START_NS, START_NS + round(end_s * 1e9))
        record = without_manual_commands(record)
        return record, motion_on_grid(self.states, record.stamp_ns, frame=FRAME)


def own_drive(*, end_s: float, taken_over_s: float = math.inf) -> OwnDrive:
    """Without a command from when a human takes over, who brakes."""
    vehicle = model_with(None)
    time_s = np.arange(round(end_s / PERIOD_S)) * PERIOD_S
    by_hand = time_s >= taken_over_s
    accel = np.where(by_hand, -3.0, 0.5 * np.sin(time_s))
    tire = np.where(by_hand, 0.0, 0.05 * np.sin(0.9 * time_s))
    begin = np.zeros((1, 8))
    begin[0, 3] = 10.0
    runner = FreeRunner(vehicle)
    (real,) = runner.run(
        states=begin, starts=np.array([0]), steps=len(time_s) - 1, accel_mps2=accel, tire_rad=tire
    )
    recorder = MotionRecorder(frame=FRAME)
    states = []
    for index, row in enumerate(real):
        stamp_ns = START_NS + round(time_s[index] * 1e9)
        lat, lon = geo_from_local(FRAME, row[:2])
        place = GeoPoint(float(lat), float(lon))
        rates, force = (0.0, 0.0, float(row[5])), (0.0, 0.0, 9.81)
        mode: ControlMode = "manual" if by_hand[index] else "autonomous"
        command = ControlCommand(
            stamp_ns=stamp_ns, accel_mps2=float(accel[index]), tire_angle_rad=float(tire[index])
        )
        for channel, message in (
            ("gnss", GnssFix(stamp_ns=stamp_ns, position=place)),
            ("speed", SpeedSample(stamp_ns=stamp_ns, speed_mps=float(row[3]))),
            ("imu", ImuSample(stamp_ns=stamp_ns, accel_mps2=force, rate_radps=rates)),
            ("status", VehicleStatus(stamp_ns=stamp_ns, control_mode=mode)),
            *((("control", command),) if mode == "autonomous" else ()),
        ):
            recorder.handle(channel, message)
        states.append(
            VehicleState(
                vehicle_id="car",
                stamp_ns=stamp_ns,
                position=place,
                yaw_rad=float(row[2]),
                speed_mps=float(row[3]),
                yaw_rate_radps=float(row[5]),
                accel_mps2=float(row[7]),
                tire_angle_rad=float(row[6]),
            )
        )
    return OwnDrive(recorder, states, runner)


def test_a_model_compared_with_itself_has_no_gap() -> None:
    """Its free runs repeat what it did itself."""
    drive = own_drive(end_s=6.0)
    record, motion = drive.until(6.0)
    samples = [
        sample
        for sample in GapMeter(drive.runner, vehicle_id="car").samples(
            record, motion, horizons_s=(1.0, 2.0)
        )
        if sample.stamp_ns > START_NS + round(1e9 * (1.0 + sample.horizon_s))
    ]
    assert len(samples) >= 4
    assert all(sample.independent for sample in samples)
    for sample in samples:
        assert math.hypot(sample.along_m, sample.across_m) < 0.03
        assert abs(sample.yaw_rad) < 0.006
        assert abs(sample.speed_mps) < 0.02
    rows = gap_table(samples)
    assert sum(row.runs for row in rows) == len(samples)


def test_what_a_human_does_after_taking_over_is_no_gap_of_the_model() -> None:
    drive = own_drive(end_s=40.0, taken_over_s=37.5)
    meter = GapMeter(drive.runner, vehicle_id="car")

    samples = meter.samples(*drive.until(40.0))
    latest = meter.latest(*drive.until(37.7), horizons_s=(2.0, 8.0))

    assert {sample.horizon_s for sample in samples} == {1.0, 2.0, 4.0, 8.0}
    assert all(sample.independent for sample in samples)
    assert max(math.hypot(one.along_m, one.across_m) for one in samples) < 0.03
    assert max(sample.stamp_ns for sample in samples) == START_NS + 37_000_000_000
    assert [sample.independent for sample in latest] == [False, False]


@pytest.fixture(scope="module")
def watched() -> dict[str | None, list[GapSample | GapAlarm | Verdict]]:
    """What a monitor says of one drive, by the fault of its model."""
    drive = drive_of(SEED, end_s=END_S)
    told: dict[str | None, list[GapSample | GapAlarm | Verdict]] = {}
    for fault in (None, "steering_ratio"):
        estimator = StateEstimator(drive.info)
        monitor = GapMonitor(drive.info, model_with(fault), frame=FRAME)
        told[fault] = []
        for channel, message in drive.samples:
            told[fault] += monitor.handle(channel, message)
            state = estimator.handle(channel, message)
            if state is not None:
                told[fault] += monitor.handle("state", state)
    return told


def test_a_monitor_gives_samples_at_each_horizon_and_no_alarm_for_a_fair_model(
    watched: dict[str | None, list[GapSample | GapAlarm | Verdict]],
) -> None:
    samples = [one for one in watched[None] if isinstance(one, GapSample)]
    assert {sample.horizon_s for sample in samples} == {1.0, 2.0, 4.0, 8.0}
    short = [sample for sample in samples if sample.horizon_s == 1.0]
    assert len(short) >= END_S - 3
    assert max(math.hypot(one.along_m, one.across_m) for one in short) < 0.5
    assert not [one for one in watched[None] if isinstance(one, GapAlarm | Verdict)]


def test_a_wrong_model_raises_an_alarm_and_then_a_verdict(
    watched: dict[str | None, list[GapSample | GapAlarm | Verdict]],
) -> None:
    alarms = [one for one in watched["steering_ratio"] if isinstance(one, GapAlarm)]
    assert {alarm.quantity for alarm in alarms if alarm.over} & {"across_m", "yaw_rad"}
    verdicts = [one for one in watched["steering_ratio"] if isinstance(one, Verdict)]
    assert [verdict.culprit for verdict in verdicts] == ["model"]
