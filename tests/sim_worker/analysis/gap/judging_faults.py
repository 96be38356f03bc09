"""Judges the stand-in's drives: what the tests of the verdict have in common."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from foretwin.contracts.drive import ControlCommand, ImuSample, SpeedSample, SteeringSample
from foretwin.contracts.gap import Verdict
from foretwin.sim_worker.analysis.gap.verdict import FaultDetector
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.sim_worker.faulty_standin import (
    CAR_FAULTS,
    DURATION_S,
    MODEL_FAULTS,
    FaultyDrive,
    drive_of,
    model_with,
)
from tests.telemetry.standin_drive import FRAME


def drive_with(fault: str | None, *, seed: int, end_s: float = DURATION_S) -> FaultyDrive:
    return drive_of(seed, fault if fault in CAR_FAULTS else None, end_s=end_s)


def verdicts_of(
    fault: str | None, *, seed: int, end_s: float = DURATION_S, until_first: bool = True
) -> list[Verdict]:
    """Return what is said of a drive; with `until_first` the first verdict alone."""
    drive = drive_with(fault, seed=seed, end_s=end_s)
    model = model_with(fault if fault in MODEL_FAULTS else None)
    said = verdicts_on(FaultDetector(drive.info, model, frame=FRAME), drive)
    return list(islice(said, 1) if until_first else said)


def verdicts_on(detector: FaultDetector, drive: FaultyDrive) -> Iterator[Verdict]:
    """Yield what a detector says of a drive as it goes on."""
    for sample in drive.samples:
        verdict = detector.handle(*sample)
        if verdict is not None:
            yield verdict


class Case(NamedTuple):
    """One fault on one way: what was said first, and after how much excitation (NaN: nothing)."""

    fault: str
    seed: int
    said: Verdict | None
    excited_s: float

    @property
    def right(self) -> bool:
        return self.said is not None and self.said.culprit == culprit_of(self.fault)

    @property
    def named(self) -> bool:
        return self.right and self.said is not None and self.said.cause in NAMES[self.fault]

    @property
    def in_time(self) -> bool:
        return self.right and self.excited_s <= IN_TIME_S


IN_TIME_S = 3.0
NAMES = {
    "slow_steering": {"steering_delay"},
    "steering_gain": {"steering_gain"},
    "saturated_steering": {"saturated_steering", "steering_gain"},
    "saturated_brake": {"saturated_brake", "brake_gain"},
    "low_drive": {"drive_gain"},
    "brake_fade": {"brake_gain", "saturated_brake"},
    "steering_read_in_degrees": {"steering_in_degrees"},
    "steering_commanded_in_degrees": {"steering_in_degrees"},
    "steering_sign": {"steering_sign"},
    "offset_steering_sensor": {"offset_sensor"},
    "offset_gyro": {"gyro_sensor"},
    "scaled_gyro": {"gyro_sensor"},
    "scaled_speed": {"speed_sensor"},
    "offset_speed": {"speed_sensor"},
    "wheelbase": {"steering_ratio"},  # whose text says "or wheelbase": motion does not tell them
    "steering_ratio": {"steering_ratio"},
    "steering_limit": {"steering_limit"},
    "steering_offset": {"steering_offset"},
    "inertia": {"inertia"},
    "friction": {"friction", "cornering_stiffness"},
    "cornering_stiffness": {"cornering_stiffness"},
    "drag": {"drag"},
    "drive_gain": {"drive_gain"},
    "brake_gain": {"brake_gain"},
    "steering_delay": {"steering_delay"},
}
"""Causes that describe each fault; two where a few seconds cannot tell them apart."""


def judged(fault: str, *, seed: int) -> Case:
    """Return what is said first of a drive with a fault."""
    told = verdicts_of(fault, seed=seed)
    said = told[0] if told else None
    late_s = float("nan") if said is None else excited_s(fault, said, seed=seed)
    return Case(fault, seed, said, late_s)


def culprit_of(fault: str) -> str:
    return "vehicle" if fault in CAR_FAULTS else "model"


_FAST_MPS, _SLIDES_MPS2 = 6.0, 1.2
_COURSE_MPS = 2.5
_ROLLS = {"offset_gyro", "scaled_speed", "offset_speed"}
_PUSHES = {"drive_gain", "low_drive"}
_BRAKES = {"brake_gain", "brake_fade", "saturated_brake"}
_FADED_MPS = 0.4
"""Deceleration summed over time that costs a fading brake a fifth of what it does."""


def excited_s(fault: str, verdict: Verdict, *, seed: int, end_s: float = DURATION_S) -> float:
    """Return how long the car had been doing what the fault shows in, when the verdict fell.

    Counted are seconds of rolling (above 0.5 m/s) in which the quantity that the fault touches is
    excited:
    - steering and its sensor, a gyro's scale, and a model that turns otherwise: the steering wheel
      is turned by 0.15 rad (9°, 0.01 rad at the tyres), as a sensor without the fault has it;
    - a speed sensor, and a gyro's offset: above 2.5 m/s, where positions tell speed and course;
    - drive, brake: the command is beyond 0.5 m/s²; of a brake that does 0.7 m/s² at most, beyond
      0.7, and of one that fades, beyond 0.5 once a fifth is lost (two of the standard deviations
      that a vehicle file gives its gain: before, it is a brake like others);
    - drag: above 6 m/s;
    - friction: a lateral acceleration beyond the 1.2 m/s² that the slippery model carries.
    """
    faulty = culprit_of(fault) == "vehicle" and fault not in _ROLLS
    clean = drive_of(seed, fault if faulty else None, end_s=end_s)
    seconds, speed_mps, braked_mps = 0.0, 0.0, 0.0
    for _, message in clean.samples:
        if getattr(message, "stamp_ns", 0) > verdict.stamp_ns:
            break
        if isinstance(message, SpeedSample):
            speed_mps = message.speed_mps
        if isinstance(message, ControlCommand):
            braked_mps += 0.02 * max(-message.accel_mps2, 0.0)
        if speed_mps < 0.5:
            continue
        if fault == "drag" or fault in _ROLLS:
            least_mps = _FAST_MPS if fault == "drag" else _COURSE_MPS
            seconds += 0.02 * (isinstance(message, SpeedSample) and speed_mps > least_mps)
        elif fault == "friction":
            slides = isinstance(message, ImuSample) and (
                abs(message.rate_radps[2]) * speed_mps > _SLIDES_MPS2
            )
            seconds += 0.01 * slides
        elif fault in _PUSHES | _BRAKES:
            sign = -1.0 if fault in _BRAKES else 1.0
            least = 0.7 if fault == "saturated_brake" else 0.5
            shows = fault != "brake_fade" or braked_mps > _FADED_MPS
            if isinstance(message, ControlCommand) and shows and sign * message.accel_mps2 > least:
                seconds += 0.02
        elif isinstance(message, SteeringSample):
            wheel = message.steering_wheel_rad or 0.0
            wheel = np.radians(wheel) if fault == "steering_read_in_degrees" else wheel
            wheel -= 0.5 if fault == "offset_steering_sensor" else 0.0
            seconds += 0.02 * (abs(wheel) > 0.15)
    return seconds


def drive_s(verdict: Verdict) -> float:
    return (verdict.stamp_ns - START_STAMP_NS) * 1e-9
