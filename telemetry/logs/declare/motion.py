"""How a car moved, as positions tell it, on an even grid: what other columns are held against."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from foretwin.contracts.arrays import Array, Flags, Indices

GRID_S = 0.05
LONGEST_S = 1500.0
"""Of longer drives the stretch of so long is taken in which most is turned."""
_SMOOTH_S = 1.0
"""Over so long a parabola is laid through positions, or over five of them: shorter, and noise is
taken for turning."""
_HOLE_S = 2.5
_PARKED_S = 600.0
"""Without positions for so long, another drive begins: a grid over days would hold nothing else."""
_SPARSEST_S = 20.0
"""Positions farther apart than this tell no motion: so are those of a clock whose unit is not
this one, a thousand times as long."""
_SPARSE_S = 6.0
"""Smoothed over so long either way where positions come every 3 s, as a fleet's mostly do."""
MOVES_MPS = 3.0
"""Below, a course says little."""
FASTEST_MPS = 90.0


class GridMotion(NamedTuple):
    """Signals on a grid, (G,) each, NaN where unknown; yaw counter-clockwise from x, unwrapped."""

    time_s: Array
    half: int
    """Signals are smoothed over so many ticks either way, and what is compared with them alike."""
    moves: Flags
    speed_mps: Array
    course_rad: Array
    turn_radps: Array
    accel_mps2: Array

    @property
    def sparse(self) -> bool:
        """Whether bends lie between positions, which make ways too short by a lot."""
        return self.half * GRID_S > _SPARSE_S

    @property
    def curvature_pm(self) -> Array:
        """Of the path, to the left."""
        return self.turn_radps / np.maximum(self.speed_mps, MOVES_MPS)

    @property
    def bending_pmps(self) -> Array:
        """Change of the path's curvature with time."""
        width = 2 * self.half + 1
        return np.asarray(
            savgol_filter(self.curvature_pm, width, 2, deriv=1, delta=GRID_S, mode="nearest")
        )


def motion_of(time_s: Array, xy_m: Array, *, whole: bool = False) -> GridMotion | None:
    """Return the motion of positions (N, 2) at rising times (N,); None where they are too few or
    too far apart.

    Unless the `whole` is wanted, of several drives the one with the most positions, and of a long
    drive the stretch that turns most.
    """
    if not whole:
        drive = _longest_drive(time_s)
        time_s, xy_m = time_s[drive], xy_m[drive]
    if len(time_s) < 10 or time_s[-1] - time_s[0] < 5.0:
        return None
    usual_s = float(np.median(np.diff(time_s)))
    if usual_s > _SPARSEST_S:
        return None
    half = max(round(0.5 * max(_SMOOTH_S, 4.0 * usual_s) / GRID_S), 2)
    grid = np.arange(time_s[0], time_s[-1], GRID_S)
    if len(grid) < 4 * half:
        return None
    places = np.stack([averaged(time_s, column, grid) for column in xy_m.T])
    width = 2 * half + 1
    vx, vy = savgol_filter(places, width, 2, deriv=1, delta=GRID_S, axis=1)
    ax, ay = savgol_filter(places, width, 2, deriv=2, delta=GRID_S, axis=1)
    speed = np.hypot(vx, vy)
    known = _near(time_s, grid, max(_HOLE_S, 3.0 * usual_s)) & (speed < FASTEST_MPS)
    moves = known & (speed > MOVES_MPS)
    square = np.maximum(speed, MOVES_MPS) ** 2
    motion = GridMotion(
        grid,
        half,
        moves,
        np.where(known, speed, np.nan),
        np.where(moves, np.unwrap(np.arctan2(vy, vx)), np.nan),
        np.where(moves, (vx * ay - vy * ax) / square, np.nan),
        np.where(moves, (vx * ax + vy * ay) / np.maximum(speed, MOVES_MPS), np.nan),
    )
    return motion if whole else _livelier(motion)


def _longest_drive(time_s: Array) -> slice:
    ends = [0, *(np.flatnonzero(np.diff(time_s) > _PARKED_S) + 1).tolist(), len(time_s)]
    return max((slice(*pair) for pair in itertools.pairwise(ends)), key=lambda s: s.stop - s.start)


def on_grid(motion: GridMotion, time_s: Array, values: Array) -> Array:
    """Return another column, smoothed alike, NaN where it is not heard of."""
    return smoothed(time_s, values, motion.time_s, half=motion.half)


def smoothed(time_s: Array, values: Array, grid: Array, *, half: int) -> Array:
    """Return values (N,) on a grid (G,), by parabolas over `half` ticks either way."""
    known = np.isfinite(values) & np.isfinite(time_s)
    time_s, values = time_s[known], values[known]
    rises = np.concatenate([[True], np.diff(np.maximum.accumulate(time_s)) > 0.0])[: len(time_s)]
    time_s, values = time_s[rises], values[rises]
    if len(time_s) < 5 or len(grid) <= 2 * half:
        return np.full(len(grid), np.nan)
    level = averaged(time_s, values, grid)
    hole_s = max(_HOLE_S, 3.0 * float(np.median(np.diff(time_s))))
    return np.where(_near(time_s, grid, hole_s), savgol_filter(level, 2 * half + 1, 2), np.nan)


def averaged(time_s: Array, values: Array, grid: Array) -> Array:
    """Return each tick's mean of values at rising times, taken as a line between them."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time_s))])
    ends = np.append(grid - 0.5 * GRID_S, grid[-1] + 0.5 * GRID_S)
    ends = np.clip(ends, time_s[0], time_s[-1])
    after = np.clip(np.searchsorted(time_s, ends), 1, len(time_s) - 1)
    before = after - 1
    part_s = ends - time_s[before]
    slope = (values[after] - values[before]) / (time_s[after] - time_s[before])
    whole = area[before] + part_s * (values[before] + 0.5 * slope * part_s)
    return np.asarray(np.diff(whole) / np.maximum(np.diff(ends), 1e-9))


def _near(time_s: Array, grid: Array, hole_s: float) -> Flags:
    after = np.clip(np.searchsorted(time_s, grid), 1, len(time_s) - 1)
    inside = (grid >= time_s[0]) & (grid <= time_s[-1])
    return np.asarray(inside & (time_s[after] - time_s[after - 1] <= hole_s))


def _livelier(motion: GridMotion) -> GridMotion:
    most = round(LONGEST_S / GRID_S)
    if len(motion.time_s) <= most:
        return motion
    turned = np.concatenate([[0.0], np.cumsum(np.nan_to_num(np.abs(motion.turn_radps)))])
    first = int(np.argmax(turned[most:] - turned[:-most]))
    part = slice(first, first + most)
    return GridMotion(
        motion.time_s[part],
        motion.half,
        motion.moves[part],
        *(signal[part] for signal in motion[3:]),
    )


def changes(columns: list[Array]) -> Indices:
    """Return the rows whose known values differ from the last known ones: the others repeat it."""
    known = np.all([np.isfinite(column) for column in columns], axis=0)
    rows = np.flatnonzero(known)
    if not len(rows):
        return rows
    differs = np.any([np.diff(column[rows]) != 0.0 for column in columns], axis=0)
    return np.asarray(rows[np.concatenate([[True], differs])])
