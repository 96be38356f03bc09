"""The estimator on the real Berlin drive, 5 Hz positions alone, against the smoothed whole log."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, wrap_angle
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs import open_log
from tests.telemetry.smoothing import SmoothedTrack, smooth_positions

pytestmark = pytest.mark.real_data
END_NS = 262_000_000_000


class Compared(NamedTuple):
    fixes: list[GnssFix]
    states: list[VehicleState]
    truth: SmoothedTrack

    def values(self, name: str) -> Array:
        return np.array([getattr(state, name) for state in self.states])

    @property
    def driving(self) -> np.ndarray:
        known = np.array([state.yaw_valid for state in self.states])
        return known & (self.truth.speed_mps > 2.0)


@functools.cache
def berlin(folder: Path) -> Compared:
    log = open_log(folder / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    estimator = StateEstimator(log.info)
    fixes, states = [], []
    for channel, message in log.samples():
        if message.stamp_ns - log.info.start_stamp_ns > END_NS:
            break
        state = estimator.handle(channel, message)
        assert isinstance(message, GnssFix)
        assert state is not None
        fixes.append(message)
        states.append(state)
    frame = LocalFrame(fixes[0].position)
    xy = local_from_geo(
        frame,
        np.array([fix.position.lat_deg for fix in fixes]),
        np.array([fix.position.lon_deg for fix in fixes]),
    )
    truth = smooth_positions(np.array([fix.stamp_ns for fix in fixes]), xy)
    return Compared(fixes, states, truth)


def lag_s(estimate: Array, truth: Array, stamp_ns: np.ndarray, driving: np.ndarray) -> float:
    """Return the delay of `truth` that explains `estimate` best, on a grid of 20 ms."""
    time_s = (stamp_ns - stamp_ns[0]) * 1e-9
    fine = np.arange(5.0, time_s[-1] - 1.0, 0.02)
    moving = np.interp(fine, time_s, driving) > 0.99
    seen = np.interp(fine, time_s, estimate)
    delays = np.arange(-0.2, 0.81, 0.02)
    errors = [
        np.mean((seen - np.interp(fine - delay, time_s, truth))[moving] ** 2) for delay in delays
    ]
    return float(delays[int(np.argmin(errors))])


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_states_are_exactly_at_the_measured_positions_but_for_fixes_that_no_car_reaches(
    data_dir: Path,
) -> None:
    drive = berlin(data_dir)
    pairs = list(zip(drive.fixes, drive.states, strict=True))
    elsewhere = [fix.stamp_ns for fix, state in pairs if state.position != fix.position]
    assert len(elsewhere) < 0.01 * len(pairs)


def test_motion_is_close_to_what_the_whole_log_says(data_dir: Path) -> None:
    drive = berlin(data_dir)
    at = drive.driving
    assert rms((drive.values("speed_mps") - drive.truth.speed_mps)[at]) < 0.08
    yaw_error = wrap_angle(drive.values("yaw_rad") - drive.truth.yaw_rad)[at]
    assert np.degrees(rms(yaw_error)) < 1.0
    # Receivers step sideways by centimetres: at 5 Hz that is most of the yaw rate's error.
    assert rms((drive.values("yaw_rate_radps") - drive.truth.yaw_rate_radps)[at]) < 0.09


@pytest.mark.parametrize("name", ["speed_mps", "yaw_rad", "yaw_rate_radps"])
def test_nothing_lags_by_more_than_a_fifth_of_a_second(data_dir: Path, name: str) -> None:
    drive = berlin(data_dir)
    estimate = drive.values(name)
    truth = getattr(drive.truth, name)
    if name == "yaw_rad":
        estimate = truth + wrap_angle(estimate - truth)
    assert lag_s(estimate, truth, drive.truth.stamp_ns, drive.driving) <= 0.2 + 1e-9


def test_the_car_does_not_turn_while_it_stands(data_dir: Path) -> None:
    drive = berlin(data_dir)
    standing = drive.truth.speed_mps < 0.05
    both = standing[1:] & standing[:-1]
    steps = np.abs(wrap_angle(np.diff(drive.values("yaw_rad"))))[both]
    assert both.sum() > 100
    assert np.degrees(steps.max()) < 0.2
    assert np.abs(drive.values("speed_mps")[standing]).max() < 0.2


def test_of_the_real_drive_only_glitches_are_held_back(data_dir: Path) -> None:
    log = open_log(data_dir / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    estimator = StateEstimator(log.info)
    for channel, message in log.samples():
        estimator.handle(channel, message)
    assert set(estimator.skipped) == {"gnss_outlier"}
    assert estimator.skipped["gnss_outlier"] < 20


def test_a_receiver_that_drifts_does_not_turn_a_standing_car(data_dir: Path) -> None:
    """From 192 s to 202 s the car stands while its positions wander by 0.3 m, mostly sideways."""
    compared = berlin(data_dir)
    seconds = np.array([state.stamp_ns for state in compared.states]) / 1e9
    standing = (seconds > 192.5) & (seconds < 201.5)
    path_m = np.hypot(*np.diff(compared.truth.xy_m[standing], axis=0).T).sum()
    assert path_m > 0.3
    assert np.ptp(np.unwrap(compared.values("yaw_rad")[standing])) < np.radians(3.0)
    assert np.abs(compared.values("tire_angle_rad")[standing])[-10:].max() < 0.05
