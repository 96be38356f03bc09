"""The plane in which a car's motion is computed, and what it takes to leave it again."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    grid_convergence,
    local_from_geo,
)

_REACH_M = 20_000.0
_FAR_M = 1e8


class LocalPlace(NamedTuple):
    """A local frame, the angle of its x axis against east here, and the height of the car."""

    frame: LocalFrame
    convergence_rad: float
    altitude_m: float

    @classmethod
    def around(cls, position: GeoPoint) -> LocalPlace:
        """Return a place whose frame begins at `position`."""
        frame = LocalFrame(GeoPoint(position.lat_deg, position.lon_deg))
        return cls(frame, 0.0, 0.0)

    def at(self, position: GeoPoint, *, antenna_up_m: float) -> LocalPlace:
        """Return the place with angle and height as at an antenna's `position`."""
        *_, convergence_rad = _projected(self.frame, position.lat_deg, position.lon_deg)
        return LocalPlace(self.frame, convergence_rad, position.alt_m - antenna_up_m)

    def xy_m(self, position: GeoPoint) -> Array:
        """Return the position in the frame, shape (2,)."""
        x_m, y_m, _ = _projected(self.frame, position.lat_deg, position.lon_deg)
        return np.array([x_m, y_m])

    def reaches(self, xy_m: Array) -> bool:
        """Whether the frame is still a good one at `xy_m` (2,)."""
        return math.hypot(xy_m[0], xy_m[1]) <= _REACH_M

    def position(self, xy_m: Array) -> GeoPoint:
        """Return where `xy_m` (2,) lies on Earth."""
        lat_deg, lon_deg = geo_from_local(self.frame, xy_m)
        return GeoPoint(float(lat_deg), float(lon_deg), self.altitude_m)


@functools.lru_cache(maxsize=256)
def _projected(frame: LocalFrame, lat_deg: float, lon_deg: float) -> tuple[float, float, float]:
    """Return x, y and the grid's convergence; samples out of order ask for the same once more."""
    x_m, y_m = local_from_geo(frame, lat_deg, lon_deg).tolist()
    if not math.isfinite(x_m + y_m):
        # Beyond the frame's reach the projection says infinity: just somewhere far away.
        x_m = y_m = _FAR_M
    return x_m, y_m, float(grid_convergence(frame, lat_deg, lon_deg))
