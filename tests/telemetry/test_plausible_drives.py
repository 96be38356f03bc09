"""Every real drive is read with its units right: positions, speeds and yaw rates fit one another.

Wrong units, signs or zeros show here whatever the reader: km/h for m/s is a factor of 3.6, degrees
for radians one of 57, a turned sign a correlation below 0.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.telemetry.logs import Log, open_log, open_road_users

DECLARATIONS = Path(__file__).parents[1] / "data" / "declarations"
STEP_S, HALF_WINDOW = 0.1, 10
"""Of the common grid; course and yaw rate are changes over 1 s to either side of it."""
DRIVES = {
    "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt": None,
    "drive-comma2k19-sf/segment40": None,
    "drive-dresden-imu/2014-03-26-000-Data.csv": "dresden.csv.toml",
    "drive-dresden-imu/2014-02-14-002-Data.csv": "dresden.csv.toml",
    "drive-boreas-toronto/boreas-2021-08-05-13-34_lidar_poses.csv": "boreas.csv.toml",
}

pytestmark = pytest.mark.real_data


class Motion(NamedTuple):
    """What positions say on the grid (N,): speed and v·κ, the rate of the course; when moving."""

    time_s: Array
    speed_mps: Array
    course_rate_radps: Array
    moving: npt.NDArray[np.bool_]


def by_channel(log: Log) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for channel, message in log.samples():
        found.setdefault(channel, []).append(message)
    return found


def times_s(messages: list[Any], start_ns: int) -> Array:
    return np.array([message.stamp_ns - start_ns for message in messages]) / 1e9


def centred(values: Array) -> Array:
    """Return the changes over two half windows per second, NaN at both ends."""
    rate = np.full(len(values), np.nan)
    rate[HALF_WINDOW:-HALF_WINDOW] = values[2 * HALF_WINDOW :] - values[: -2 * HALF_WINDOW]
    return rate / (2 * HALF_WINDOW * STEP_S)


def motion_of(fixes: list[Any]) -> Motion:
    lat = np.array([fix.position.lat_deg for fix in fixes])
    lon = np.array([fix.position.lon_deg for fix in fixes])
    xy = np.asarray(local_from_geo(LocalFrame(fixes[0].position), lat, lon))
    at_s = times_s(fixes, fixes[0].stamp_ns)
    time_s = np.arange(0.0, at_s[-1], STEP_S)
    velocity = [centred(np.interp(time_s, at_s, column)) for column in xy.T]
    speed = np.hypot(*velocity)
    course = np.unwrap(np.nan_to_num(np.arctan2(velocity[1], velocity[0])))
    around = np.ones(4 * HALF_WINDOW + 1)
    moving = np.convolve(speed > 3.0, around, "same") > len(around) - 0.5
    moving[: 2 * HALF_WINDOW] = moving[-2 * HALF_WINDOW :] = False
    return Motion(time_s, speed, centred(course), moving)


def yaw_rate_of(found: dict[str, list[Any]], motion: Motion) -> Array | None:
    """Return the measured yaw rate on the grid, averaged as the course is; None without one."""
    turning = [m for m in found.get("heading", []) if m.yaw_rate_radps is not None]
    rates = np.array([m.yaw_rate_radps for m in turning])
    if "imu" in found:
        turning, rates = found["imu"], np.array([m.rate_radps[2] for m in found["imu"]])
    if not turning:
        return None
    at_s = times_s(turning, found["gnss"][0].stamp_ns)
    turned = np.concatenate([[0.0], np.cumsum(rates[1:] * np.diff(at_s))])
    window = np.ones(2 * HALF_WINDOW + 1) / (2 * HALF_WINDOW + 1)
    return centred(np.convolve(np.interp(motion.time_s, at_s, turned), window, "same"))


@pytest.mark.parametrize("name", DRIVES)
def test_positions_speeds_and_yaw_rates_fit_one_another(data_dir: Path, name: str) -> None:
    declared = DRIVES[name]
    log = open_log(
        data_dir / name, declaration=None if declared is None else DECLARATIONS / declared
    )
    found = by_channel(log)
    motion = motion_of(found["gnss"])
    moving = motion.moving
    assert moving.sum() * STEP_S > 15.0
    assert np.percentile(motion.speed_mps[moving], 99) < 35.0
    assert np.percentile(np.abs(motion.speed_mps * motion.course_rate_radps)[moving], 95) < 5.0
    if "speed" in found:
        told = np.array([message.speed_mps for message in found["speed"]])
        at_s = times_s(found["speed"], found["gnss"][0].stamp_ns)
        measured = np.interp(motion.time_s, at_s, told)
        ratio = measured[moving].sum() / motion.speed_mps[moving].sum()
        assert ratio == pytest.approx(1.0, abs=0.1)
    rate = yaw_rate_of(found, motion)
    if rate is not None:
        fit = np.corrcoef(motion.course_rate_radps[moving], rate[moving])[0, 1]
        assert fit > 0.75
        slope = np.polyfit(rate[moving], motion.course_rate_radps[moving], 1)[0]
        assert 0.8 < slope < 1.25


def test_road_users_move_as_fast_as_they_are_said_to(data_dir: Path) -> None:
    files = sorted((data_dir / "traffic-mcity-rtk" / "dets").glob("*.json"))
    assert files
    ratios = []
    for file in files:
        for track in open_road_users(file).tracks:
            together = ~track.gone_after[:-1]
            frame = LocalFrame(GeoPoint(float(track.lat_deg[0]), float(track.lon_deg[0])))
            xy = np.asarray(local_from_geo(frame, track.lat_deg, track.lon_deg))
            way_m = np.hypot(*np.diff(xy, axis=0).T)[together].sum()
            said_m = (
                0.5 * (track.speed_mps[1:] + track.speed_mps[:-1]) * np.diff(track.stamps_ns) / 1e9
            )[together].sum()
            if way_m > 30.0 and track.kind == "car":
                ratios.append(said_m / way_m)
    assert len(ratios) > 3
    assert np.median(ratios) == pytest.approx(1.0, abs=0.1)
