"""The estimator on real drives whose sensors disagree: lagging courses, unknown places."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, wrap_angle
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs import Log, open_log
from tests.telemetry.estimator_figures import boreas
from tests.telemetry.smoothing import SmoothedTrack, smooth_positions

COVERS = (
    "foretwin.telemetry.estimator.kinematic_filter",
    "foretwin.telemetry.estimator.motion_noise",
)

pytestmark = pytest.mark.real_data
DECLARATIONS = Path(__file__).parents[1] / "data" / "declarations"


class Compared(NamedTuple):
    """Valid states with M stamps in ns, the truth of N positions, and both in one frame."""

    states: list[VehicleState]
    stamp_ns: Array
    xy_m: Array
    truth: SmoothedTrack
    skipped: dict[str, int]

    def rms(self, name: str) -> float:
        """Return the error of a field while the car drives."""
        estimate = np.array([getattr(state, name) for state in self.states])
        truth = np.interp(self.stamp_ns, self.truth.stamp_ns, getattr(self.truth, name))
        moving = np.interp(self.stamp_ns, self.truth.stamp_ns, self.truth.speed_mps) > 2.0
        error = estimate - truth
        if name == "yaw_rad":
            error = wrap_angle(error)
        return float(np.sqrt(np.mean(np.square(error[moving]))))


def compared(log: Log, *, until_s: float, position_std_m: float) -> Compared:
    estimator = StateEstimator(log.info)
    states, fixes = [], []
    for channel, message in log.samples():
        if message.stamp_ns - log.info.start_stamp_ns > until_s * 1e9:
            break
        state = estimator.handle(channel, message)
        if channel == "gnss":
            fixes.append(message)
        if state is not None and state.yaw_valid:
            states.append(state)
    frame = LocalFrame(fixes[0].position)

    def local(places: list) -> Array:
        return local_from_geo(
            frame,
            np.array([place.position.lat_deg for place in places]),
            np.array([place.position.lon_deg for place in places]),
        )

    stamps = np.array([fix.stamp_ns for fix in fixes])
    return Compared(
        states,
        np.array([state.stamp_ns for state in states], dtype=np.float64),
        local(states),
        smooth_positions(stamps, local(fixes), position_std_m=position_std_m, jerk_density=1.0),
        dict(estimator.skipped),
    )


def test_a_course_that_lags_does_not_lead_the_track_away(data_dir: Path) -> None:
    """Dresden: speed and course come half a second after the positions, the gyro before them."""
    drive = compared(
        open_log(
            data_dir / "drive-dresden-imu" / "2014-03-26-000-Data.csv",
            declaration=DECLARATIONS / "dresden.csv.toml",
        ),
        until_s=120.0,
        position_std_m=1.0,
    )
    east, north = (
        np.interp(drive.stamp_ns, drive.truth.stamp_ns, drive.truth.xy_m[:, k]) for k in (0, 1)
    )
    off = np.hypot(drive.xy_m[:, 0] - east, drive.xy_m[:, 1] - north)
    assert np.percentile(off, 95) < 1.5
    assert drive.rms("speed_mps") < 1.0
    assert drive.rms("yaw_rate_radps") < 0.15
    assert set(drive.skipped) <= {"gnss_repeated", "gnss_outlier"}


def test_measured_heading_and_speed_agree_with_the_positions(data_dir: Path) -> None:
    """Boreas: the lidar's own place on the car is unknown, so its course differs in bends."""
    drive = compared(
        open_log(
            next((data_dir / "drive-boreas-toronto").glob("*.csv")),
            declaration=DECLARATIONS / "boreas.csv.toml",
        ),
        until_s=120.0,
        position_std_m=0.01,
    )
    assert drive.rms("speed_mps") < 0.1
    assert np.degrees(drive.rms("yaw_rad")) < 2.0
    assert drive.rms("yaw_rate_radps") < 0.06
    assert not drive.skipped
    assert "yaw_rad" not in drive.states[-1].estimated


def test_positions_alone_give_the_course_and_the_yaw_rate(data_dir: Path) -> None:
    """In bends the lidar's own course differs from the car's by its place on the car, fitted."""
    found = boreas(data_dir, until_s=150.0)
    course = np.degrees(np.abs(found.course_rad))
    mounted = np.degrees(np.abs(found.course_rad - found.mounting_rad))
    assert np.median(course) < 0.4
    assert np.percentile(mounted, 95) < 2.0
    assert 0.0 < found.lever_m < 2.0
    assert np.sqrt(np.mean(found.yaw_rate_radps**2)) < 0.07
    assert found.yaw_rate_lag_s < 0.11  # one period of the positions
