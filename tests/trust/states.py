"""What the causal estimator makes of a log: its states as columns."""

from __future__ import annotations

import time
from collections import Counter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs import Log


class States(NamedTuple):
    """N states with a known heading, in a frame; standard deviations are NaN where none is told.

    `position_std_m` is on each axis. `estimator` is as the log left it.
    """

    stamp_ns: npt.NDArray[np.int64]
    xy_m: Array
    yaw_rad: Array
    speed_mps: Array
    position_std_m: Array
    yaw_std_rad: Array
    speed_std_mps: Array
    estimator: StateEstimator
    skipped: Counter[str]
    samples: int
    us_per_sample: float


def states_of(log: Log, frame: LocalFrame) -> States:
    """Return the states of a log whose samples come in the order of their stamps."""
    estimator = StateEstimator(log.info)
    samples = list(log.samples())
    begun_s = time.process_time()
    given = [estimator.handle(channel, message) for channel, message in samples]
    cost_s = time.process_time() - begun_s
    known = [state for state in given if state is not None and state.yaw_valid]
    lat, lon = (
        np.array([getattr(s.position, name) for s in known]) for name in ("lat_deg", "lon_deg")
    )
    yaw = np.array([state.yaw_rad for state in known])
    return States(
        np.array([state.stamp_ns for state in known], dtype=np.int64),
        local_from_geo(frame, lat, lon),
        np.asarray(local_from_geo_yaw(frame, yaw, lat, lon)),
        _column(known, "speed_mps"),
        _column(known, "position_std_m"),
        _column(known, "yaw_std_rad"),
        _column(known, "speed_std_mps"),
        estimator,
        estimator.skipped,
        len(samples),
        cost_s / max(1, len(samples)) * 1e6,
    )


def _column(states: list[VehicleState], name: str) -> Array:
    return np.array([getattr(state, name) for state in states], dtype=np.float64)
