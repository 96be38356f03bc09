"""Elevation models drawn by a formula, for tests that know how steep the ground is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from foretwin.world_gen.elevation.dem import Dem, DemSet

Hill = Callable[[Array, Array], Array]
"""Heights (...) of places east and north of a point, in metres."""


def raster(
    hill: Hill,
    origin: GeoPoint,
    *,
    arc_s: float = 3.0,
    noise_m: float = 0.0,
    seed: int = 0,
    reach_deg: float = 0.03,
) -> DemSet:
    """Return an elevation model of `hill` around its origin, in cells of `arc_s` seconds."""
    step = arc_s / 3600.0
    count = round(2.0 * reach_deg / step) + 1
    lat = origin.lat_deg + reach_deg - np.arange(count) * step
    lon = origin.lon_deg - reach_deg + np.arange(count) * step
    lons, lats = np.meshgrid(lon, lat)
    xy = local_from_geo(LocalFrame(origin), lats.ravel(), lons.ravel())
    heights = hill(xy[:, 0], xy[:, 1]).reshape(count, count)
    heights = heights + np.random.default_rng(seed).normal(0.0, 1.0, heights.shape) * noise_m
    return DemSet(
        (
            Dem(
                name="drawn.hgt",
                sha256=f"drawn {seed}",
                heights_m=heights,
                first_x=float(lon[0]),
                first_y=float(lat[0]),
                step_x=step,
                step_y=-step,
            ),
        )
    )
