"""How good a table's forecasts are on a drive, calibrated as they would be while driving."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.forecast import crps_of
from foretwin.orchestrator.forecast.calibration import Calibration, shares_of
from foretwin.orchestrator.forecast.examples import Examples
from foretwin.orchestrator.forecast.features import FEATURES
from foretwin.orchestrator.forecast.own_error import with_own_error
from foretwin.orchestrator.forecast.progress_model import ProgressModel
from foretwin.sim_worker.driver_model import STANDING_MPS

BAND = (0.1, 0.9)


class DriveScore(NamedTuple):
    """Of N forecasts of a moving car at T instants, each (N, T): `share` of it that lay below what
    came, CRPS calibrated and as the table has it, width of the band from p10 to p90 of both, and
    how far the median and two predictions without a table were off."""

    stamp_ns: Array
    share: Array
    table_share: Array
    crps_m: Array
    table_crps_m: Array
    width_m: Array
    table_width_m: Array
    median_off_m: Array
    constant_speed_off_m: Array
    constant_accel_off_m: Array

    @property
    def coverage(self) -> float:
        """Part of what came that lay from p10 to p90."""
        return float(np.mean((self.share >= BAND[0]) & (self.share <= BAND[1])))

    @property
    def table_coverage(self) -> float:
        """The same of the table alone."""
        return float(np.mean((self.table_share >= BAND[0]) & (self.table_share <= BAND[1])))


def score(
    model: ProgressModel, drive: Examples, *, blind: bool = False, truth_m: Array | None = None
) -> DriveScore:
    """Return how a drive's forecasts come out, in its order; `blind` without the way ahead.

    Calibrated by what the car itself measured, and scored by it: what that errs is nothing that a
    drive can see. With `truth_m` (N, T) scored by this, and widened by the car's own error.
    """
    calibration = Calibration(model.time_s)
    waiting: deque[tuple[int, int, float]] = deque()
    times_ns = np.round(model.time_s * 1e9).astype(np.int64)
    rows: list[tuple[Array, ...]] = []
    features = drive.blind if blind else drive.features
    accel_place = FEATURES.index("accel_mps2")
    for place in np.flatnonzero(drive.speed_mps >= STANDING_MPS).tolist():
        now_ns = int(drive.stamp_ns[place])
        came = drive.distance_m[place]
        true = came if truth_m is None else truth_m[place]
        for _ in range(len(waiting)):
            due_ns, instant, share = waiting.popleft()
            if due_ns <= now_ns:
                calibration.take(instant, now_ns / 1e9, share)
            else:
                waiting.append((due_ns, instant, share))
        table = model.forecast(features[place])
        told = calibration.calibrated(table)
        if truth_m is not None:
            told = with_own_error(told, float(drive.speed_std_mps[place]))
        measured_share = shares_of(table, came[:, None])[:, 0]
        speed, accel = drive.speed_mps[place], features[place, accel_place]
        rows.append(
            (
                shares_of(told, true[:, None])[:, 0],
                shares_of(table, true[:, None])[:, 0],
                crps_of(told.levels, told.distance_m, true),
                crps_of(table.levels, table.distance_m, true),
                told.at(BAND[1]) - told.at(BAND[0]),
                table.at(BAND[1]) - table.at(BAND[0]),
                np.abs(told.median_m - true),
                np.abs(speed * model.time_s - true),
                np.abs(_steady(speed, accel, model.time_s) - true),
            )
        )
        waiting.extend(
            (now_ns + int(after), k, float(measured_share[k])) for k, after in enumerate(times_ns)
        )
    moving = drive.stamp_ns[drive.speed_mps >= STANDING_MPS]
    shape = (len(rows), len(model.time_s))
    columns = [np.array(column).reshape(shape) for column in zip(*rows, strict=True)]
    return DriveScore(moving, *(columns or [np.zeros(shape)] * 9))


def _steady(speed_mps: float, accel_mps2: float, time_s: Array) -> Array:
    """Return how far a car gets that keeps its acceleration, until it stands."""
    until = time_s if accel_mps2 >= 0.0 else np.minimum(time_s, speed_mps / -accel_mps2)
    return np.asarray(speed_mps * until + 0.5 * accel_mps2 * until * until)
