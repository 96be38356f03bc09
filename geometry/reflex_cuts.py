"""Polygons cut into convex pieces along the walls that meet at their reflex corners.

Cutting on along a wall leaves rectangles where walls are square, which a triangulation merged back
to convex pieces does not, and takes at most one piece more than there are reflex corners. All
polygons are cut at the same time, one corner each, until none is left.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import cross, left_of

_SNAP_M = 1e-6
_TO_CORNER_M = 0.06
"""A cut that ends this near a corner ends there, lest a sliver be left beside it."""
_MIN_AREA_M2 = 1e-4
_EQUAL_M2, _SURE_M2 = 1e-6, 0.01
_DENSIFY = 0.1
_POLYGON = 3
_INTO_HOLE_M = 0.002
"""Holes are opened by cuts this far inside them."""

Geometries = npt.NDArray[np.object_]
Indices = npt.NDArray[np.intp]


def cut_at_reflex_corners(polygons: Geometries, tolerance_m: float) -> tuple[Geometries, Indices]:
    """Return convex pieces of valid polygons, and the index of the polygon each is of.

    A piece whose convex hull lies within `tolerance_m` of it is taken for its hull.
    """
    pieces, owner = _without_holes(polygons)
    done: list[Geometries] = []
    done_owner: list[Indices] = []
    while len(pieces):
        hulls = shapely.convex_hull(pieces)
        convex = nearly_the_same(hulls, pieces, tolerance_m)
        done.append(hulls[convex])
        done_owner.append(owner[convex])
        if convex.all():
            break
        pieces, owner = _cut_once(pieces[~convex], owner[~convex])
    if not done:
        return pieces, owner
    return np.concatenate(done), np.concatenate(done_owner)


def nearly_the_same(
    shapes: Geometries, others: Geometries, tolerance_m: float, *, convex: bool = False
) -> npt.NDArray[np.bool_]:
    """Return which polygons' edges lie within `tolerance_m` of the edges of those they hold.

    Where all `others` are known to be `convex`, none is farther than at a corner of `shapes`.
    """
    missing = np.abs(shapely.area(shapes) - shapely.area(others))
    near: npt.NDArray[np.bool_] = missing <= _EQUAL_M2
    # A strip along the edge is no wider than this only where it has no more area than that.
    at = np.flatnonzero(~near & (missing <= tolerance_m * shapely.length(shapes)))
    a, b = shapely.get_exterior_ring(shapes[at]), shapely.get_exterior_ring(others[at])
    at_corners = shapely.hausdorff_distance(a, b) <= tolerance_m
    at, a, b = at[at_corners], a[at_corners], b[at_corners]
    if convex:
        near[at] = True
        return near
    # The corners alone miss a pocket behind a spike: look along the edges too.
    doubtful = missing[at] > _SURE_M2
    along = shapely.hausdorff_distance(a[doubtful], b[doubtful], densify=_DENSIFY) <= tolerance_m
    near[at[~doubtful]] = True
    near[at[doubtful][along]] = True
    return near


def polygons_of(shapes: Geometries, owner: Indices) -> tuple[Geometries, Indices]:
    """Return the polygons that shapes of any kind hold, and the owner of each."""
    while (shapely.get_type_id(shapes) > _POLYGON).any():
        shapes, of = shapely.get_parts(shapes, return_index=True)
        owner = owner[of]
    keep = (shapely.get_type_id(shapes) == _POLYGON) & (shapely.area(shapes) > _MIN_AREA_M2)
    return shapes[keep], owner[keep]


def _without_holes(polygons: Geometries) -> tuple[Geometries, Indices]:
    """Return polygons cut along a wall of each hole, so that no hole is left."""
    todo, owner = polygons, np.arange(len(polygons))
    done: list[Geometries] = []
    done_owner: list[Indices] = []
    while True:
        holed = shapely.get_num_interior_rings(todo) > 0
        done.append(todo[~holed])
        done_owner.append(owner[~holed])
        if not holed.any():
            return np.concatenate(done), np.concatenate(done_owner)
        todo, owner = np.repeat(todo[holed], 2), np.repeat(owner[holed], 2)
        halves = np.array([half for p in todo[::2].tolist() for half in _halves(p)], dtype=object)
        todo, owner = polygons_of(shapely.intersection(todo, halves), owner)


def _halves(polygon: shapely.Polygon) -> tuple[shapely.Polygon, shapely.Polygon]:
    """Return the two halves of the plane beside the longest wall of a polygon's first hole."""
    ring = shapely.get_interior_ring(polygon, 0)
    hole = shapely.get_coordinates(ring)
    steps = np.diff(hole, axis=0)
    k = int(np.argmax((steps * steps).sum(axis=1)))
    ahead = steps[k] / np.hypot(*steps[k])
    left = left_of(ahead)
    at = hole[k] + left * (_INTO_HOLE_M if shapely.is_ccw(ring) else -_INTO_HOLE_M)
    west, south, east, north = polygon.bounds
    far = 2.0 * (east - west + north - south)
    a, b, aside = at - ahead * far, at + ahead * far, left * far
    return shapely.Polygon([a, b, b + aside, a + aside]), shapely.Polygon(
        [a, b, b - aside, a - aside]
    )


class _Corners:
    """The corners of many rings in one row: where each is, its ring, and its neighbours."""

    def __init__(self, pieces: Geometries) -> None:
        rings = shapely.get_exterior_ring(shapely.orient_polygons(pieces))
        counts = shapely.get_num_coordinates(rings) - 1
        closed = shapely.get_coordinates(rings)
        last = np.cumsum(counts + 1) - 1
        self.xy: Array = np.delete(closed, last, axis=0)
        self.count: Indices = counts
        self.first: Indices = np.cumsum(counts) - counts
        self.ring: Indices = np.repeat(np.arange(len(counts)), counts)
        row = np.arange(len(self.xy))
        self.after = row + 1
        self.after[self.first + counts - 1] = self.first
        self.before = row - 1
        self.before[self.first] = self.first + counts - 1

    def sharpest(self) -> Indices:
        """Return for each ring its reflex corner between the longest walls."""
        into, out = self.xy - self.xy[self.before], self.xy[self.after] - self.xy
        return self._least(cross(into, out))

    def hits(self, corner: Indices, ahead: Array) -> tuple[Array, Indices, Array]:
        """Return where rays `ahead` (2, R, 2), two from a corner of each ring, meet it next.

        That is distance (2, R), wall (2, R) and place (2, R, 2); the distance is infinite where a
        ray meets nothing.
        """
        a, b = self.xy, self.xy[self.after]
        start, along = self.xy[corner][self.ring], ahead[:, self.ring]
        side_a, side_b = cross(along, a - start), cross(along, b - start)
        side_a[np.abs(side_a) < _SNAP_M] = 0.0
        side_b[np.abs(side_b) < _SNAP_M] = 0.0
        gap = side_a - side_b
        share = np.divide(side_a, gap, out=np.zeros_like(gap), where=gap != 0.0)
        place = a + (b - a) * share[..., None]
        distance = ((place - start) * along).sum(axis=-1)
        row = np.arange(len(a))
        meets = (side_a * side_b <= 0.0) & (gap != 0.0) & (distance > _SNAP_M)
        meets &= (row != corner[self.ring]) & (self.after != corner[self.ring])
        distance = np.where(meets, distance, np.inf)
        nearest = self._least(distance)
        ray = np.arange(2)[:, None]
        return distance[ray, nearest], nearest, place[ray, nearest]

    def _least(self, values: Array) -> Indices:
        """Return for each ring the first of its corners with the least of `values` (…, P)."""
        least = np.minimum.reduceat(values, self.first, axis=-1)
        row = np.arange(len(self.xy))
        at = np.where(values == least[..., self.ring], row, len(row))
        found: Indices = np.minimum.reduceat(at, self.first, axis=-1)
        return found


def _cut_once(pieces: Geometries, owner: Indices) -> tuple[Geometries, Indices]:
    """Return the halves of pieces without holes, cut on along a wall at one reflex corner each.

    A piece that cannot be cut so is returned as its triangles.
    """
    corners = _Corners(pieces)
    corner = corners.sharpest()
    here = corners.xy[corner]
    on, back = here - corners.xy[corners.before[corner]], here - corners.xy[corners.after[corner]]
    away, walls, places = corners.hits(corner, _unit(np.stack([on, back])))
    nearer = away[0] <= away[1]
    wall = np.where(nearer, walls[0], walls[1])
    place = np.where(nearer[:, None], places[0], places[1])
    stuck = ~np.isfinite(away.min(axis=0))
    ends = np.stack([wall, corners.after[wall]], axis=1)
    neighbours = np.stack([corner, corners.before[corner], corners.after[corner]], axis=1)
    off = np.hypot(*np.moveaxis(corners.xy[ends] - place[:, None], 2, 0))
    off[(ends[:, :, None] == neighbours[:, None, :]).any(axis=2)] = np.inf
    end = np.where(off.min(axis=1) < _TO_CORNER_M, off.argmin(axis=1), -1)
    made = _halves_at(corners, corner, wall, end, place, np.flatnonzero(~stuck))
    found, found_owner = made, np.repeat(owner[~stuck], 2)
    if stuck.any():
        # Where rounding has made a piece cross itself, no ray meets a wall.
        sound, sound_owner = polygons_of(shapely.make_valid(pieces[stuck]), owner[stuck])
        triangles, which = shapely.get_parts(
            shapely.constrained_delaunay_triangles(sound), return_index=True
        )
        found = np.concatenate([made, triangles])
        found_owner = np.concatenate([found_owner, sound_owner[which]])
    solid = shapely.area(found) > _MIN_AREA_M2
    return found[solid], found_owner[solid]


def _halves_at(
    corners: _Corners, corner: Indices, wall: Indices, end: Indices, place: Array, rings: Indices
) -> Geometries:
    """Return both halves of chosen `rings`, cut from a corner to a place on a wall.

    `end` is 0 or 1 where that end of the wall stands for the place, else -1.
    """
    c, w, end = corner[rings], wall[rings], end[rings]
    # One half runs from the corner to the wall's begin, the other from the wall's end on.
    start = np.stack([c, w + (end != 0)], axis=1).ravel()
    stop = np.stack([w + (end == 1), c], axis=1).ravel()
    first, count = np.repeat(corners.first[rings], 2), np.repeat(corners.count[rings], 2)
    run = (stop - start) % count + 1
    # A new point ends the first half and begins the second.
    new = np.repeat(end < 0, 2)
    second = np.arange(len(run)) % 2 == 1
    half = np.repeat(np.arange(len(run)), run + new)
    at = np.arange(len(half)) - np.searchsorted(half, half)
    step = start - first - (new & second)
    rows = first[half] + (step[half] + at) % count[half]
    is_new = new[half] & (at == np.where(second, 0, run)[half])
    rows[is_new] = len(corners.xy) + np.repeat(rings, 2)[half[is_new]]
    made: Geometries = shapely.polygons(
        shapely.linearrings(np.concatenate([corners.xy, place])[rows], indices=half)
    )
    return made


def _unit(vectors: Array) -> Array:
    size = np.hypot(vectors[..., 0], vectors[..., 1])
    unit: Array = vectors / np.maximum(size, 1e-12)[..., None]
    return unit
