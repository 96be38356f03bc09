"""How well the estimator does: on a bad network, without positions, and on real drives.

    python -m tests.telemetry.estimator_figures [DATA_FOLDER]

prints tables; the stand-in's take about two minutes of CPU. With the folder of real data also what
positions alone give on Boreas, against the course and yaw rate that were recorded there.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import HeadingSample
from foretwin.contracts.frames import local_from_geo, wrap_angle
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs import open_log
from tests.telemetry.city_drive import FRAME, antenna_xy, city_drive, phone_positions
from tests.telemetry.city_errors import FOREIGN, Heard, heard, without
from tests.telemetry.impaired import PERFECT, Network

DECLARATIONS = Path(__file__).parents[1] / "data" / "declarations"
BEND_S = (47.0, 57.0)
_SEEDS = range(4)


class PositionsAlone(NamedTuple):
    """Errors of a filter fed with positions alone while the car drives faster than 3 m/s.

    `course_rad` (N,) and `yaw_rate_radps` (N,) against what was recorded, `bend` (N,) where the
    recorded yaw rate is above 0.1 rad/s; lags in seconds explain the estimate best. A sensor that
    is mounted `lever_m` ahead of the rear axle has a course that differs by lever times curvature:
    the lever is fitted, and its part is what `text` calls the mounting.
    """

    mounting_rad: Array
    course_rad: Array
    yaw_rate_radps: Array
    bend: np.ndarray
    lever_m: float
    course_lag_s: float
    yaw_rate_lag_s: float

    def text(self) -> str:
        """Return the figures in one line."""
        course, rate = np.degrees(np.abs(self.course_rad)), np.abs(self.yaw_rate_radps)
        mounted = np.degrees(np.abs(self.course_rad - self.mounting_rad))
        return (
            f"course p50 {np.median(course):.2f} p95 {np.percentile(course, 95):.2f} deg, "
            f"in bends p95 {np.percentile(course[self.bend], 95):.2f} deg, "
            f"without the mounting ({self.lever_m:.2f} m ahead) p95 "
            f"{np.percentile(mounted, 95):.2f} deg, "
            f"lag {self.course_lag_s:.2f} s; "
            f"yaw rate rms {np.sqrt(np.mean(rate**2)):.4f} p95 {np.percentile(rate, 95):.4f} rad/s,"
            f" lag {self.yaw_rate_lag_s:.2f} s; {len(course)} states"
        )


def boreas(folder: Path, *, until_s: float = np.inf) -> PositionsAlone:
    """Return what positions alone give on the Boreas drive."""
    log = open_log(
        next((folder / "drive-boreas-toronto").glob("*.csv")),
        declaration=DECLARATIONS / "boreas.csv.toml",
    )
    estimator = StateEstimator(log.info)
    recorded: dict[int, HeadingSample] = {}
    states = {}
    for channel, message in log.samples():
        if message.stamp_ns - log.info.start_stamp_ns > until_s * 1e9:
            break
        if channel == "heading":
            recorded[message.stamp_ns] = message
        elif channel == "gnss":
            state = estimator.handle(channel, message)
            if state is not None and state.yaw_valid:
                states[message.stamp_ns] = state
    stamps = np.array([stamp for stamp in states if stamp in recorded])
    time_s = (stamps - stamps[0]) * 1e-9
    fast = np.array([states[stamp].speed_mps > 3.0 for stamp in stamps])
    course = np.unwrap([states[stamp].yaw_rad for stamp in stamps])
    true_course = np.unwrap([recorded[stamp].yaw_rad for stamp in stamps])
    rate = np.array([states[stamp].yaw_rate_radps for stamp in stamps])
    true_rate = np.array([recorded[stamp].yaw_rate_radps or 0.0 for stamp in stamps])
    aligned = true_course + np.asarray(wrap_angle(course - true_course))
    speed = np.array([states[stamp].speed_mps for stamp in stamps])
    curvature = (true_rate / np.maximum(speed, 1.0))[fast]
    lever_m = float(curvature @ (aligned - true_course)[fast] / (curvature @ curvature))
    return PositionsAlone(
        lever_m * curvature,
        (aligned - true_course)[fast],
        (rate - true_rate)[fast],
        np.abs(true_rate[fast]) > 0.1,
        lever_m,
        _lag_s(aligned, true_course, time_s, fast),
        _lag_s(rate, true_rate, time_s, fast),
    )


def _lag_s(estimate: Array, truth: Array, time_s: Array, driving: np.ndarray) -> float:
    """Return the delay of `truth` that explains `estimate` best, on a grid of 10 ms."""
    fine = np.arange(5.0, time_s[-1] - 1.0, 0.02)
    moving = np.interp(fine, time_s, driving) > 0.99
    seen = np.interp(fine, time_s, estimate)
    delays = np.arange(-0.2, 0.61, 0.01)
    off = [np.var((seen - np.interp(fine - at, time_s, truth))[moving]) for at in delays]
    return float(delays[int(np.argmin(off))])


def _line(name: str, drive: Heard, *, from_s: float = 0.0) -> str:
    at = drive.time_s >= from_s
    found = drive.estimator.clock
    exact_s = -FOREIGN.ahead_s - FOREIGN.fast_ppm * 1e-6 * drive.time_s[-1]
    clock = (
        ""
        if found.offset_ns is None
        else (
            f"  clock {1e3 * (found.offset_ns * 1e-9 - exact_s):+.2f} ms {found.drift_ppm:+.1f} ppm"
        )
    )
    return (
        f"{name:34s} position p50 {np.median(drive.position_m[at]):.3f} "
        f"p95 {np.percentile(drive.position_m[at], 95):.3f} m  "
        f"heading p95 {np.degrees(np.percentile(drive.yaw_rad[at], 95)):.2f} deg  "
        f"speed rms {np.sqrt(np.mean(drive.speed_mps[at] ** 2)):.3f} m/s  "
        f"yaw rate rms {np.sqrt(np.mean(drive.yaw_rate_radps[at] ** 2)):.4f} rad/s{clock}  "
        f"{drive.cpu_us_per_sample:.0f} us/sample"
    )


def main(arguments: list[str]) -> int:
    """Print the figures."""
    for folder in arguments:
        print("Boreas, positions alone:", boreas(Path(folder)).text())
    samples = city_drive().samples
    print(_line("in order, no network", heard(samples, network=PERFECT, with_receipt=False)))
    print(_line("bad network, +1 s, 50 ppm", heard(samples)))
    print(_line("40 % lost, 150 ms jitter", heard(samples, network=Network(0.4, 0.02, 0.01, 0.15))))
    lost = heard(without(samples, "gnss", *BEND_S))
    end = lost.between(BEND_S[1] - 0.5, BEND_S[1])
    print(_line("10 s without positions in a bend", lost))
    print(f"  error at their end {lost.position_m[end].max():.2f} m")
    for seed in _SEEDS:
        phone = phone_positions(city_drive(), seed=seed)
        raw = [
            np.hypot(
                *(
                    local_from_geo(FRAME, fix.position.lat_deg, fix.position.lon_deg)
                    - antenna_xy(city_drive(), fix.stamp_ns)
                )
            )
            for channel, fix in phone
            if channel == "gnss"
        ]
        drive = heard(phone, seed=seed)
        print(_line(f"phone {seed}, raw p95 {np.percentile(raw, 95):.2f} m", drive, from_s=30.0))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
