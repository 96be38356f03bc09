"""The vehicle's estimated states on the grid of its record: what a free run is compared with.

What the vehicle is doing follows from its measured motion alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, get_args

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices, Stamps
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.gap import Manoeuvre
from foretwin.sim_worker.analysis.motion_record import between_samples

LONGEST_GAP_S = 0.5
"""Between states farther apart the motion is not known. Chosen."""


class MeasuredMotion(NamedTuple):
    """Base_link at N instants in a local frame; NaN where no state is near.

    Standard deviations are 0 where states give none.
    """

    x_m: Array
    y_m: Array
    yaw_rad: Array
    speed_mps: Array
    yaw_rate_radps: Array
    accel_mps2: Array
    position_std_m: Array
    yaw_std_rad: Array
    speed_std_mps: Array

    def at(self, index: int | Indices) -> MeasuredMotion:
        """Return the motion at one instant, or at some."""
        return MeasuredMotion(*(column[index] for column in self))

    @property
    def known(self) -> Flags:
        """Where the motion is known, shape (N,)."""
        return np.isfinite(self.x_m)


def motion_on_grid(
    states: Sequence[VehicleState], stamp_ns: Stamps, *, frame: LocalFrame
) -> MeasuredMotion:
    """Interpolate states with a known heading to `stamp_ns` (N,), which ascend.

    Positions are without what a map has moved them by: that is no motion of the car. States out of
    time order or with numbers that are not finite are passed over.
    """
    rows: list[tuple[float, ...]] = []
    base_ns = int(stamp_ns[0])
    for state in states:
        place = state.position
        values = (
            place.lat_deg,
            place.lon_deg,
            state.yaw_rad,
            state.speed_mps,
            state.yaw_rate_radps,
            state.accel_mps2,
            state.position_std_m or 0.0,
            state.yaw_std_rad or 0.0,
            state.speed_std_mps or 0.0,
            *(state.map_shift_m or (0.0, 0.0)),
        )
        time_s = (state.stamp_ns - base_ns) * 1e-9
        if state.yaw_valid and np.isfinite(values).all() and (not rows or time_s > rows[-1][0]):
            rows.append((time_s, *values))
    at = np.asarray((stamp_ns - base_ns) * 1e-9, dtype=np.float64)
    if len(rows) < 2:
        return MeasuredMotion(*(np.full(len(at), np.nan) for _ in MeasuredMotion._fields))
    table = np.array(rows)
    xy = local_from_geo(frame, table[:, 1], table[:, 2]) - table[:, 10:12]
    yaw = np.unwrap(local_from_geo_yaw(frame, table[:, 3], table[:, 1], table[:, 2]))
    columns = (xy[:, 0], xy[:, 1], yaw, *table[:, 4:10].T)
    return MeasuredMotion(
        *(between_samples(table[:, 0], column, at, gap_s=LONGEST_GAP_S) for column in columns)
    )


MANOEUVRES: tuple[Manoeuvre, ...] = get_args(Manoeuvre)
_STANDS_MPS = 0.3
_BRAKES_MPS2, _ACCELERATES_MPS2 = -0.7, 0.7
_CURVE_RADPS, _CURVE_PM = 0.06, 0.01


def manoeuvre_of(
    *, speed_mps: Array | float, yaw_rate_radps: Array | float, accel_mps2: Array | float
) -> Manoeuvre:
    """Name what a stretch of motion is, from its mean speed, yaw rate and acceleration.

    Standing counts first, then the change of speed, then the bend: a car that brakes in a bend
    is braking.
    """
    speed = float(np.mean(np.abs(speed_mps)))
    rate, accel = float(np.mean(yaw_rate_radps)), float(np.mean(accel_mps2))
    if speed < _STANDS_MPS:
        return "standstill"
    if accel < _BRAKES_MPS2:
        return "braking"
    if accel > _ACCELERATES_MPS2:
        return "accelerating"
    if abs(rate) > _CURVE_RADPS or abs(rate) / max(speed, 1.0) > _CURVE_PM:
        return "curve"
    return "straight"
