"""What futures aim at: speeds along their way and in its bends, and a place across it."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import SPEED_AHEAD_STEP_S, Job
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import LATERAL_ACCEL_MPS2
from foretwin.sim_worker.futures.number_columns import NumberColumns

_MAX_OFFSET_M = 8.0


class Aims(NamedTuple):
    """What each of S futures aims at; all (S,).

    `speed_ahead_mps` (K, S), `SPEED_AHEAD_STEP_S` apart, goes before `target_speed_mps` where the
    job says how the nominal future's speed changes; None where it does not.
    """

    target_speed_mps: Array
    speed_factor: Array
    offset_m: Array
    speed_ahead_mps: Array | None = None

    def at(self, time_s: float | npt.NDArray[np.floating]) -> tuple[Array, Array | None]:
        """Return the speeds (S,) aimed at, and the accelerations (S,) with which these change,
        None where they stay. `time_s` is one, or (S,) of futures that began at different times."""
        ahead = self.speed_ahead_mps
        if ahead is None:
            return self.target_speed_mps, None
        if isinstance(time_s, np.ndarray):
            return _by_row(ahead, time_s)
        place = time_s / SPEED_AHEAD_STEP_S
        node = int(place + 1e-9)  # ticks come a hair before their instants
        if node >= len(ahead) - 1:
            return ahead[-1], None
        rise = ahead[node + 1] - ahead[node]
        return ahead[node] + (place - node) * rise, rise / SPEED_AHEAD_STEP_S


def _by_row(ahead_mps: Array, time_s: npt.NDArray[np.floating]) -> tuple[Array, Array]:
    """Return what `Aims.at` does for each of S futures at a time of its own."""
    place = time_s / SPEED_AHEAD_STEP_S
    node = np.minimum((place + 1e-9).astype(np.intp), len(ahead_mps) - 1)
    after, rows = np.minimum(node + 1, len(ahead_mps) - 1), np.arange(len(time_s))
    rise = ahead_mps[after, rows] - ahead_mps[node, rows]
    return ahead_mps[node, rows] + (place - node) * rise, rise / SPEED_AHEAD_STEP_S


def aims_of(job: Job, present_offset_m: Array, numbers: NumberColumns) -> Aims:
    """Return what a job's S futures aim at that begin `present_offset_m` (S,) beside the path."""
    cruise = np.array([future.values.get("ego.speed_mps", np.nan) for future in job.futures])
    if job.starts is None:
        cruise[[not future.place for future in job.futures]] = np.nan
    cruise = np.where(np.isfinite(cruise), cruise, job.cruise_speed_mps)
    target = numbers.applied("aim.target_speed_mps", cruise)
    ahead = None
    if not isinstance(job.speed_ahead_mps, msgspec.UnsetType):
        speeds = [numbers.applied("aim.target_speed_mps", v) for v in job.speed_ahead_mps.tolist()]
        ahead = np.maximum(speeds, 0.0)
    factor = numbers.factor("aim.target_speed_mps")
    factor = np.where(cruise > 1.0, target / np.maximum(cruise, 1.0), factor)
    # The future keeps the car's present offset, or one would measure the map's error.
    present = np.minimum(np.maximum(present_offset_m, -_MAX_OFFSET_M), _MAX_OFFSET_M)
    return Aims(np.maximum(target, 0.0), factor, numbers.applied("aim.offset_m", present), ahead)


def bend_accel_of(job: Job) -> float:
    """Return what a job's nominal future takes across the way in bends."""
    own = job.bend_accel_mps2
    return LATERAL_ACCEL_MPS2 if isinstance(own, msgspec.UnsetType) else own


def limit_share(path: FrenetPath, start_arc_m: float) -> Array | None:
    """Return (M,) how far the limits lie below the one where the car is, at most 1; None for 1.

    A driver's speed relates to the limit, which the map may have guessed: only its drops count.
    """
    limits = path.speed_limit_mps
    here = limits[int(np.clip(np.searchsorted(path.arc_m, start_arc_m), 0, len(limits) - 1))]
    if not np.isfinite(here):
        return None
    share = np.minimum(np.where(np.isfinite(limits), limits, here) / here, 1.0)
    return np.asarray(share) if share.min() < 1.0 else None
