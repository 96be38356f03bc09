"""What two engines together are worth against what real cars did."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.sim_worker.analysis.gap.free_run import FreeRunner
from foretwin.sim_worker.analysis.motion_record import PERIOD_S
from foretwin.sim_worker.futures.run_job import stage_for
from foretwin.sim_worker.vehicle.lag import without_lags
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.seeding import kinematic_tire_angle, local_state
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs.opening import open_log
from tests.sim_worker.analysis.gap.real_drives import DECLARATIONS, LOGS

HORIZON_S, EVERY_S, LEAST_MPS, MOST_APART_S = 4.0, 2.0, 3.0, 0.3
MORE_LOGS = {
    "drive-berlin-potsdamer-platz": "*_GT.txt*",
    "drive-frankfurt-westend": "*_GT.txt",
}


class Windows(NamedTuple):
    """K windows of a drive: errors in metres of MuJoCo, the other engine and the mean of both after
    4 s, and how far apart both are."""

    mujoco: Array
    other: Array
    mean: Array
    apart: Array


def windows_of(file: Path, declaration: Path | None) -> Windows | None:
    """Let both engines go on from measured states with the measured speed and turning."""
    car = without_lags(load_vehicle())
    log = open_log(file, declaration=declaration)
    estimator, frame = StateEstimator(log.info), None
    rows, states = [], []
    for channel, message in log.samples():
        state = estimator.handle(channel, message)
        if state is None or not state.yaw_valid:
            continue
        frame = frame or LocalFrame(state.position)
        lat, lon = state.position.lat_deg, state.position.lon_deg
        x, y = local_from_geo(frame, lat, lon)
        yaw = float(local_from_geo_yaw(frame, state.yaw_rad, lat, lon))
        rows.append(
            (state.stamp_ns / 1e9, float(x), float(y), yaw, state.speed_mps, state.yaw_rate_radps)
        )
        states.append(local_state(state, frame, car))
    if len(rows) < 10:
        return None
    table = np.array(rows)
    time_s = table[:, 0] - table[0, 0]
    grid = np.arange(0.0, time_s[-1], PERIOD_S)
    x, y, speed, rate = (np.interp(grid, time_s, table[:, k]) for k in (1, 2, 4, 5))
    tire = np.array([kinematic_tire_angle(car, u, r) for u, r in zip(speed, rate, strict=True)])
    late = np.diff(time_s, prepend=time_s[0])
    steps, starts, begin = round(HORIZON_S / PERIOD_S), [], []
    next_s = 0.0
    for row, now_s in enumerate(time_s):
        at, inside = round(now_s / PERIOD_S), (time_s >= now_s) & (time_s <= now_s + HORIZON_S)
        whole = at + steps < len(grid) and late[inside].max() <= MOST_APART_S
        if now_s >= next_s and table[row, 4] > LEAST_MPS and whole:
            starts.append(at)
            begin.append(states[row])
            next_s = now_s + EVERY_S
    if not starts:
        return None
    at, first = np.array(starts), np.stack(begin)
    first[:, 6] = tire[at]
    ends = []
    for engine in ("mujoco", "multibody"):
        runner = FreeRunner(car)
        runner._stage = stage_for(engine, None, car, nsim=32, control_hz=1.0 / PERIOD_S)  # type: ignore[arg-type]
        runs = runner.run(
            states=first,
            starts=at,
            steps=steps,
            accel_mps2=np.zeros(len(grid)),
            tire_rad=tire,
            hold_speed_mps=speed,
            delayed=False,
        )
        ends.append(runs[:, -1, :2])
    real = np.column_stack([x, y])[at + steps]
    away = [np.hypot(*(end - real).T) for end in (*ends, (ends[0] + ends[1]) / 2.0)]
    return Windows(away[0], away[1], away[2], np.hypot(*(ends[0] - ends[1]).T))


def drives(data: Path) -> Iterator[tuple[str, Path, Path | None]]:
    """Yield the real drives of the folder that have times."""
    for name, declared in LOGS.items():
        yield name, data / name, None if declared is None else DECLARATIONS / declared
    for folder, pattern in MORE_LOGS.items():
        for file in sorted((data / folder).glob(pattern)):
            yield f"{folder}/{file.name}", file, None


def reality_text(data: Path) -> Iterator[str]:
    """Yield a line for each drive, and one for all windows."""
    found = []
    for name, file, declaration in drives(data):
        windows = windows_of(file, declaration)
        if windows is None:
            yield f"{name}: no window of {HORIZON_S:g} s"
            continue
        found.append(windows)
        yield _line(name, windows)
    if found:
        yield _line(
            "all", Windows(*(np.concatenate(column) for column in zip(*found, strict=True)))
        )


def _line(name: str, windows: Windows) -> str:
    medians = [float(np.median(column)) for column in windows]
    rank = spearmanr(windows.apart, windows.mujoco).statistic if len(windows.apart) > 2 else np.nan
    p95 = [float(np.percentile(column, 95)) for column in windows]
    return (
        f"{name}: {len(windows.apart)} windows, {HORIZON_S:g} s ahead, median (p95): mujoco "
        f"{medians[0]:.3f} ({p95[0]:.2f}) m, multibody {medians[1]:.3f} ({p95[1]:.2f}) m, their "
        f"mean {medians[2]:.3f} ({p95[2]:.2f}) m; apart {medians[3]:.3f} ({p95[3]:.2f}) m, "
        f"rank correlation with mujoco's error {rank:.2f}"
    )
