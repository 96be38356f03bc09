"""A drive as what it did at each metre of its way, and where it was at each moment."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.geometry.polyline import arc_lengths

STEP_M = 1.0
"""Between two places of a line."""
_MOVED_M, _CREPT_M, _CREEPS_MPS = 0.5, 3.0, 0.3
"""Nearer states are noise of positions, and of a car that hardly moves those nearer than 3 m."""
_HOLE_M, _HOLE_S = 40.0, 3.0
"""A drive is not known between states so far apart, nor over so long, unless it hardly moves."""
_COURSE_M = 3.0


class DriveLine(NamedTuple):
    """A drive at even metres of its way, N places: `xy_m` (N, 2) in a frame, `along` (N, 2) unit
    directions, when it first came there, its speed and acceleration.

    `piece` (N,) numbers stretches without a hole. `moment_s` (M,) and `moment_m` (M,) are all its
    moments and how far it had come, standing still included. `std_m` is the median of what its
    positions are known to, None where they do not say.
    """

    arc_m: Array
    xy_m: Array
    along: Array
    time_s: Array
    speed_mps: Array
    accel_mps2: Array
    piece: Indices
    moment_s: Array
    moment_m: Array
    std_m: float | None

    @property
    def length_m(self) -> float:
        """How far it drove, holes left out."""
        return float(STEP_M * (np.diff(self.piece) == 0).sum())

    def at_m(self, values: Array, arc_m: Array) -> Array:
        """Interpolate `values` (N,) at arc lengths."""
        return np.interp(arc_m, self.arc_m, values)

    def come_m(self, time_s: Array) -> Array:
        """Return how far it had come at times."""
        return np.interp(time_s, self.moment_s, self.moment_m)


def drive_line(states: Sequence[VehicleState], frame: LocalFrame) -> DriveLine | None:
    """Return a drive's states in the order of their stamps as a line in a frame.

    None where it moved less than two places. Times count from the first state.
    """
    told = [state for state in states if state.yaw_valid]
    if len(told) < 2:
        return None
    lat, lon, speed, accel = np.array(
        [(s.position.lat_deg, s.position.lon_deg, s.speed_mps, s.accel_mps2) for s in told]
    ).T
    time_s = np.array([s.stamp_ns - told[0].stamp_ns for s in told]) * 1e-9
    xy = np.asarray(local_from_geo(frame, lat, lon))
    kept = _moved(xy, speed)
    arc = arc_lengths(xy[kept])
    if arc[-1] < 2.0 * STEP_M:
        return None
    # Where the car is between two kept states: behind the next one.
    last = np.searchsorted(kept, np.arange(len(xy)), side="right") - 1
    since = np.hypot(*(xy - xy[kept[last]]).T)
    most = np.append(arc[1:], arc[-1])[last]
    moment_m = np.maximum.accumulate(np.minimum(arc[last] + since, most))
    step_m, step_s = np.diff(arc), np.diff(time_s[kept])
    hole = (step_m > _HOLE_M) | ((step_s > _HOLE_S) & (step_m > 2.0 * STEP_M * _HOLE_S))
    at = np.arange(0.0, arc[-1], STEP_M)
    stds = [s.position_std_m for s in told if s.position_std_m is not None]
    points = np.column_stack([np.interp(at, arc, xy[kept, k]) for k in (0, 1)])
    ends = [np.clip(at + way, 0.0, arc[-1]) for way in (_COURSE_M, -_COURSE_M)]
    ahead, behind = (
        np.column_stack([np.interp(end, arc, xy[kept, k]) for k in (0, 1)]) for end in ends
    )
    way = ahead - behind
    return DriveLine(
        arc_m=at,
        xy_m=points,
        along=way / np.maximum(np.hypot(*way.T), 1e-9)[:, None],
        time_s=np.interp(at, arc, time_s[kept]),
        speed_mps=np.interp(at, arc, speed[kept]),
        accel_mps2=np.interp(at, arc, accel[kept]),
        piece=_pieces(at, arc, hole),
        moment_s=time_s,
        moment_m=moment_m,
        std_m=float(np.median(stds)) if stds else None,
    )


def _moved(xy: Array, speed_mps: Array) -> Indices:
    """Return the rows of states that have left the one kept before."""
    least_m = np.where(np.abs(speed_mps) < _CREEPS_MPS, _CREPT_M, _MOVED_M).tolist()
    kept, points = [0], xy.tolist()
    for row, point in enumerate(points):
        if math.dist(point, points[kept[-1]]) >= least_m[row]:
            kept.append(row)
    return np.array(kept)


def _pieces(at: Array, arc: Array, hole: Flags) -> Indices:
    """Number places by how many holes they lie behind; inside a hole each is a piece of its own."""
    step = np.clip(np.searchsorted(arc, at, side="right") - 1, 0, len(hole) - 1)
    inside = hole[step]
    found: Indices = np.cumsum(inside | np.append(False, inside[:-1]))
    return found
