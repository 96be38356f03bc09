"""How far the estimator's states lie from the stand-in's truth on the minute in a town."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import wrap_angle
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.standin.source import START_STAMP_NS
from tests.telemetry.city_drive import Sample, city_drive, xy_of
from tests.telemetry.impaired import BAD, ForeignClock, Network, impaired

FOREIGN = ForeignClock(ahead_s=1.0, fast_ppm=50.0)
MOTION = ("imu", "speed", "steering", "gnss")


class Heard(NamedTuple):
    """States at `time_s` (N,) of the drive, their errors (N,), and what it cost."""

    estimator: StateEstimator
    states: list[VehicleState]
    time_s: Array
    position_m: Array
    yaw_rad: Array
    speed_mps: Array
    yaw_rate_radps: Array
    stated_std_m: Array
    cpu_us_per_sample: float

    def between(self, from_s: float, to_s: float) -> np.ndarray:
        return (self.time_s >= from_s) & (self.time_s < to_s)


def heard(
    samples: Iterable[Sample],
    *,
    network: Network = BAD,
    clock: ForeignClock = FOREIGN,
    seed: int = 0,
    with_receipt: bool = True,
) -> Heard:
    """Return what an estimator makes of the city drive's `samples` through a network."""
    drive = city_drive()
    estimator = StateEstimator(drive.source.info, steering=drive.source.steering)
    arrivals = impaired(samples, network, clock=clock, seed=seed)
    begun_s = time.process_time()
    states = [
        estimator.handle(channel, message, received_ns=at if with_receipt else None)
        for channel, message, at in arrivals
    ]
    cpu_s = time.process_time() - begun_s
    known = [state for state in states if state is not None and state.yaw_valid]
    truth = [drive.source.truth(state.stamp_ns) for state in known]
    pairs = list(zip(known, truth, strict=True))
    return Heard(
        estimator,
        known,
        (np.array([state.stamp_ns for state in known]) - START_STAMP_NS) * 1e-9,
        np.hypot(*np.array([xy_of(a) - xy_of(b) for a, b in pairs]).T),
        np.array([abs(float(wrap_angle(a.yaw_rad - b.yaw_rad))) for a, b in pairs]),
        np.array([a.speed_mps - b.speed_mps for a, b in pairs]),
        np.array([a.yaw_rate_radps - b.yaw_rate_radps for a, b in pairs]),
        np.array([state.position_std_m for state in known], dtype=np.float64),
        cpu_s / sum(arrival.channel in MOTION for arrival in arrivals) * 1e6,
    )


def without(samples: Iterable[Sample], channel: str, from_s: float, to_s: float) -> list[Sample]:
    """Return the samples but those of one channel in a stretch of the drive."""
    first, last = (START_STAMP_NS + round(at * 1e9) for at in (from_s, to_s))
    return [
        sample
        for sample in samples
        if sample[0] != channel or not first < sample[1].stamp_ns < last
    ]
