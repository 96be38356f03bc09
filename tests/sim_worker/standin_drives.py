"""The stand-in car's drive through a town, laid on a grid, for identification and the gap."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any

import numpy as np

from foretwin.contracts.drive import ControlCommand, GnssFix, ImuSample, SpeedSample, SteeringSample
from foretwin.contracts.frames import GeoPoint, geo_from_local
from foretwin.contracts.tuning import Identification, ParameterEstimate
from foretwin.sim_worker.analysis.motion_record import MotionRecord, MotionRecorder
from foretwin.telemetry.standin.parameters import StandinParameters, read_parameters
from foretwin.telemetry.standin.path import DrivenPath
from foretwin.telemetry.standin.source import START_STAMP_NS, StandinSource
from tests.telemetry.city_drive import city_drive
from tests.telemetry.standin_drive import FRAME, Drive

PERIOD_S = 0.01
MINUTE_S = 60.0
_TOLD = (
    "x_m", "y_m", "altitude_m", "speed_mps", "yaw_rate_radps",
    "wheel_rad", "command_accel_mps2", "command_wheel_rad",
)  # fmt: skip


def recorded(samples: Iterable[tuple[str, Any]], *, until_s: float = MINUTE_S) -> MotionRecord:
    """Return the first `until_s` seconds of a stand-in drive's samples, every 10 ms."""
    recorder = MotionRecorder(frame=FRAME, keep_s=600.0)
    for channel, message in samples:
        recorder.handle(channel, message)
    last = min(recorder.newest_stamp_ns or 0, START_STAMP_NS + round(until_s * 1e9))
    return recorder.record(START_STAMP_NS, last, period_s=PERIOD_S)


@functools.cache
def city_minute() -> MotionRecord:
    """Return a minute of city driving with the bundled stand-in car."""
    return recorded(city_drive().samples)


def driven(path: DrivenPath, parameters: StandinParameters, *, seed: int, end_s: float) -> Drive:
    """Return a drive along `path` of a car other than the bundled one."""
    source = StandinSource(path, parameters, vehicle_id="standin", seed=seed, end_s=end_s)
    return Drive(source, list(source.advance(START_STAMP_NS + round(end_s * 1e9))))


def straight_minute(*, speed_mps: float = 33.0, seed: int = 0) -> MotionRecord:
    """Return a minute on a straight motorway as the bundled car's sensors would tell it.

    The wheel makes the small corrections of lane keeping, and so does the pedal; made by formula,
    because at that speed the multi-body model has nothing to add.
    """
    parameters = read_parameters()
    car, sensors = parameters.car, parameters.sensors
    random = np.random.default_rng(seed)
    time_s = np.arange(0.0, MINUTE_S, PERIOD_S)
    count = len(time_s)
    tyre = 2e-4 * np.sin(2.0 * np.pi * 0.2 * time_s) + 1e-4 * np.sin(2.0 * np.pi * 0.45 * time_s)
    pedal = 0.05 * np.sin(2.0 * np.pi * 0.05 * time_s)
    speed = speed_mps + np.cumsum(pedal) * PERIOD_S
    wheel = (tyre - car.steering_offset_rad) * car.steering_ratio
    rate = speed * tyre / 2.5789128
    drag = (car.drag_npv2 * speed**2 + car.rolling_resistance_n) / 1093.3
    absent = np.full(count, np.nan)
    return MotionRecord(
        stamp_ns=START_STAMP_NS + np.round(time_s * 1e9).astype(np.int64),
        x_m=np.cumsum(speed) * PERIOD_S,
        y_m=np.zeros(count),
        altitude_m=np.full(count, 1.45),
        yaw_rad=absent,
        speed_mps=speed + random.normal(0.0, sensors.speed_std_mps, count),
        yaw_rate_radps=rate
        + sensors.gyro_bias_radps
        + random.normal(0.0, sensors.gyro_std_radps, count),
        accel_x_mps2=pedal,
        wheel_rad=wheel + random.normal(0.0, sensors.steering_wheel_std_rad, count),
        tire_rad=absent,
        command_accel_mps2=(pedal + drag) / car.drive_gain,
        command_wheel_rad=wheel,
        command_tire_rad=absent,
        command_age_s=np.zeros(count),
        manual=np.zeros(count, dtype=np.bool_),
    )


def samples_of(record: MotionRecord) -> list[tuple[str, Any]]:
    """Return the samples that a record would come from: one of each sensor at each instant."""
    samples: list[tuple[str, Any]] = []
    for index, stamp in enumerate(record.stamp_ns):
        ns, at = int(stamp), {name: float(getattr(record, name)[index]) for name in _TOLD}
        place = geo_from_local(FRAME, np.array([at["x_m"], at["y_m"]]))
        force = (0.0, 0.0, 9.81)
        position = GeoPoint(float(place[0]), float(place[1]), at["altitude_m"])
        samples += [
            ("gnss", GnssFix(stamp_ns=ns, position=position, std_m=0.02)),
            ("speed", SpeedSample(stamp_ns=ns, speed_mps=at["speed_mps"])),
            ("imu", ImuSample(
                stamp_ns=ns, accel_mps2=force, rate_radps=(0.0, 0.0, at["yaw_rate_radps"]))),
            ("steering", SteeringSample(stamp_ns=ns, steering_wheel_rad=at["wheel_rad"])),
            ("control", ControlCommand(
                stamp_ns=ns, accel_mps2=at["command_accel_mps2"],
                steering_wheel_rad=at["command_wheel_rad"])),
        ]  # fmt: skip
    return samples


def estimate(told: Identification, name: str) -> ParameterEstimate:
    """Return the estimate of one parameter."""
    (found,) = (given for given in told.estimates if given.name == name)
    return found
