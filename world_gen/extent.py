"""Where a World ends: a disc around a junction, or a rectangle of map."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise

import msgspec
import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local
from foretwin.contracts.world import World
from foretwin.geometry.polyline import Flags, arc_lengths, length, points_at

MIN_PIECE_M = 0.5
"""Shorter pieces of road at the World's edge are left out."""


class Disc(msgspec.Struct, frozen=True, dict=True):
    """All within `radius_m` of the World's origin."""

    radius_m: float

    @property
    def bounds_m(self) -> tuple[float, float, float, float] | None:
        """None: a disc has its radius alone."""
        return None

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The disc as a polygon in the World's frame."""
        return shapely.Point(0.0, 0.0).buffer(self.radius_m, quad_segs=32)

    def holds(self, xy_m: Array) -> Flags:
        """Return for points (…, 2) whether they lie inside, as (…) of bool."""
        inside: Flags = np.hypot(xy_m[..., 0], xy_m[..., 1]) <= self.radius_m
        return inside

    def crossings(self, xy_m: Array) -> list[float]:
        """Return arc lengths at which a polyline (N, 2) meets the edge."""
        a, d = xy_m[:-1], np.diff(xy_m, axis=0)
        aa = np.maximum((d * d).sum(axis=1), 1e-12)
        half_b = (a * d).sum(axis=1)
        disc = half_b * half_b - aa * ((a * a).sum(axis=1) - self.radius_m**2)
        root = np.sqrt(np.maximum(disc, 0.0))
        shares = np.stack([-half_b - root, -half_b + root]) / aa
        at, length = arc_lengths(xy_m)[:-1], np.sqrt(aa)
        found: list[float] = (at + shares * length)[
            (disc > 0.0) & (shares > 0.0) & (shares < 1.0)
        ].tolist()
        return found


class Rectangle(msgspec.Struct, frozen=True):
    """All between `west_m`, `south_m`, `east_m` and `north_m` of the World's origin."""

    west_m: float
    south_m: float
    east_m: float
    north_m: float

    @property
    def radius_m(self) -> float:
        """Distance of the farthest corner from the origin."""
        west_m, south_m, east_m, north_m = map(abs, self.bounds_m)
        return math.hypot(max(west_m, east_m), max(south_m, north_m))

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """West, south, east and north."""
        return (self.west_m, self.south_m, self.east_m, self.north_m)

    @property
    def polygon(self) -> shapely.Polygon:
        """The rectangle as a polygon in the World's frame."""
        return shapely.box(self.west_m, self.south_m, self.east_m, self.north_m)

    def holds(self, xy_m: Array) -> Flags:
        """Return for points (…, 2) whether they lie inside, as (…) of bool."""
        west_m, south_m, east_m, north_m = self.bounds_m
        low, high = xy_m >= (west_m, south_m), xy_m <= (east_m, north_m)
        return np.asarray((low & high).all(axis=-1))

    def crossings(self, xy_m: Array) -> list[float]:
        """Return arc lengths at which a polyline (N, 2) meets the lines of the edge."""
        s = arc_lengths(xy_m)
        found: list[float] = []
        for axis, level in zip((0, 1, 0, 1), self.bounds_m, strict=True):
            gap = xy_m[:, axis] - level
            for i in np.nonzero(gap[:-1] * gap[1:] < 0.0)[0]:
                share = gap[i] / (gap[i] - gap[i + 1])
                found.append(float(s[i] + share * (s[i + 1] - s[i])))
        return found


Extent = Disc | Rectangle


def extent_of(world: World) -> Extent:
    """Return where a World ends."""
    return Disc(world.radius_m) if world.bounds_m is None else Rectangle(*world.bounds_m)


def stretches_inside(xy_m: Array, extent: Extent) -> list[tuple[float, float]]:
    """Return the arc lengths (from, to) between which a polyline (N, 2) lies inside, in order."""
    total = length(xy_m)
    if extent.holds(xy_m).all():  # both extents are convex
        return [(0.0, total)]
    cuts = [0.0, *sorted(extent.crossings(xy_m)), total]
    found: list[tuple[float, float]] = []
    for begin, stop in pairwise(cuts):
        middle = points_at(xy_m, np.array([0.5 * (begin + stop)]))
        if stop - begin > 1e-9 and extent.holds(middle)[0]:
            if found and found[-1][1] == begin:
                begin = found.pop()[0]
            found.append((begin, stop))
    return [(a, b) for a, b in found if b - a > MIN_PIECE_M]


def box_deg(area: shapely.Geometry, frame: LocalFrame) -> shapely.Polygon:
    """Return a box of longitudes and latitudes around a shape in `frame`, some 100 m to spare.

    Meridians curve in the frame. Across the antimeridian the box goes all around.
    """
    ring = shapely.segmentize(shapely.box(*area.bounds), max(area.length / 64.0, 1.0))
    lat, lon = geo_from_local(frame, shapely.get_coordinates(ring)).T
    if np.ptp(lon) > 180.0:
        return shapely.box(-180.0, lat.min() - 1e-3, 180.0, lat.max() + 1e-3)
    return shapely.box(lon.min() - 1e-3, lat.min() - 1e-3, lon.max() + 1e-3, lat.max() + 1e-3)
