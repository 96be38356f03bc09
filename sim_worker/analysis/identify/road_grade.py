"""The grade of the road along a recorded drive: by measured altitude, or by a map's heights."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.analysis.identify.regression import smoothed_and_rate
from foretwin.sim_worker.analysis.motion_record import MotionRecord
from foretwin.sim_worker.vehicle.gravity import lost_to_grade_mps2
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2

_WAY_WIDTH_S, _MOVES_MPS = 0.5, 0.5
"""Positions scatter: which way the car goes is told by those of a second."""
_REACH_M = 25.0
"""Roads keep their grade over such lengths; half of the fit's window."""
_LEAST_M = 10.0
_ENOUGH_STD = 0.005
"""Half a per cent of grade is 0.05 m/s²: a thirtieth of ordinary braking."""


def grade_from_altitude(record: MotionRecord) -> Array:
    """Return rise over run (N,), a line through the altitudes within 25 m of way either side.

    Raises ValueError where altitude is absent, zero throughout, or too noisy to tell half a per
    cent of grade.
    """
    if not record.has("altitude_m") or not record.has("speed_mps"):
        raise ValueError("the road's grade is unknown: no altitude was measured")
    if not np.any(np.nan_to_num(record.altitude_m)):
        raise ValueError("the road's grade is unknown: altitude is zero throughout, so not told")
    period_s = float(record.time_s[1])
    way_m = np.cumsum(np.abs(np.nan_to_num(record.speed_mps))) * period_s
    known = np.isfinite(record.altitude_m)
    spacing_m = 1.0
    at = np.arange(way_m[0], way_m[-1] + spacing_m, spacing_m)
    if len(at) < 2 * _LEAST_M:
        raise ValueError(f"the road's grade is unknown: the car drove {len(at)} m only")
    cell = np.clip(np.searchsorted(at, way_m[known]) - 1, 0, len(at) - 1)
    weight = np.bincount(cell, minlength=len(at)).astype(np.float64)
    height = np.bincount(cell, weights=record.altitude_m[known], minlength=len(at))
    filled = np.interp(at, at[weight > 0.0], height[weight > 0.0] / weight[weight > 0.0])
    reach = np.arange(-_REACH_M, _REACH_M + 1.0)
    padded = np.pad(filled, int(_REACH_M), mode="reflect", reflect_type="odd")
    square = float(np.sum(np.square(reach)))
    slope = np.convolve(padded, -reach / square, mode="valid") / spacing_m
    # Heights with the slope taken out of them scatter as the receiver does, from metre to metre.
    rough = np.diff(filled - np.cumsum(slope) * spacing_m)
    std = float(np.std(rough)) / np.sqrt(2.0 * square)
    if std > _ENOUGH_STD:
        raise ValueError(
            f"the road's grade is unknown: altitude tells it to ± {196.0 * std:.1f} % only"
        )
    return np.asarray(np.interp(way_m, at, slope))


def grade_from_roads(record: MotionRecord, roads: Slopes) -> Array:
    """Return rise over run (N,) of the roads under the car, towards where it gets on.

    Raises ValueError where no position was measured, or the car never moved.
    """
    if not record.has("x_m") or not record.has("y_m"):
        raise ValueError("the road's grade is unknown: no position was measured")
    xy = np.array([_filled(record.x_m), _filled(record.y_m)])
    period_s = float(record.time_s[1])
    ahead = np.array(
        [smoothed_and_rate(row, period_s=period_s, width_s=_WAY_WIDTH_S)[1] for row in xy]
    )
    speed = np.hypot(*ahead)
    told = speed > _MOVES_MPS  # not where it is unknown
    if not told.any():
        raise ValueError("the road's grade is unknown: the car does not move")
    # Before and after, and while it stands, the car heads as it did or will.
    at = np.arange(len(speed))
    known = at[told]
    after = np.minimum(np.searchsorted(known, at), len(known) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(at - known[before] < known[after] - at, known[before], known[after])
    return roads.grade_at(xy, (ahead / np.maximum(speed, 1e-9))[:, nearest])


def _filled(values: Array) -> Array:
    at = np.arange(len(values))
    known = np.isfinite(values)
    return np.asarray(np.interp(at, at[known], values[known]))


class Climb(NamedTuple):
    """What slopes take of the acceleration (N,), and how far that is off, in m/s²."""

    mps2: Array
    std_mps2: float


def climb_under(record: MotionRecord, roads: Slopes | None) -> Climb | None:
    """Return what the slope takes along a record; None where the map has no heights.

    Measured altitude tells it better than a map. Where neither tells it, it is 0.
    """
    if roads is None:
        return None
    std = 0.0
    try:
        grade = grade_from_altitude(record)
    except ValueError:
        std = GRAVITY_MPS2 * roads.grade_std
        try:
            grade = grade_from_roads(record, roads)
        except ValueError:
            grade = np.zeros(len(record.stamp_ns))
    return Climb(lost_to_grade_mps2(grade), std)
