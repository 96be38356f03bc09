"""The road's grade along a drive from measured altitude."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.motion_record import MotionRecord

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
