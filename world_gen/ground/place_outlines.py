"""Outlines of places where roads meet in one point, from the mouths of their roads alone.

Joining what turns sweep and rounding the result off is the general way to pave a place, and by far
the most expensive step of a World. Most places are simple: kerb to kerb, with a round corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import left_of, meeting, units
from foretwin.geometry.polyline_batch import Polylines, points_at
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneSet
from foretwin.world_gen.roads.road_graph import EdgeKey

CORNER_STEPS = 6
SHARPEST_CORNER_M = 0.3
FARTHEST_CORNER_M = 40.0
PARALLEL = 0.05
"""Sine of the angle between kerbs that are taken to run on straight."""
SAMPLES = (0.2, 0.35, 0.5, 0.65, 0.8)
CAR_HALF_WIDTH_M = 1.0
"""Paths must lie so far inside an outline, else the place is paved by what is swept."""


class PlaceOutlines(NamedTuple):
    """Simple places: rows of `Surroundings.clusters`, and their polygons."""

    rows: tuple[int, ...]
    polygons: np.ndarray


class _Mouths(NamedTuple):
    """Where roads begin at places, seen outward: their edges' first points and those after."""

    left: Array
    left_next: Array
    right: Array
    right_next: Array


def simple_outlines(
    around: Surroundings, lanes: LaneSet, connections: Sequence[ConnectionDraft]
) -> PlaceOutlines:
    """Return the outlines of places with one node whose paths all lie well inside."""
    row_of, ends = _road_ends(lanes)
    rows: list[int] = []
    mouths: list[int] = []
    nodes: list[Array] = []
    for i, cluster in enumerate(around.clusters):
        if len(cluster.nodes) > 1 or cluster.ring or cluster.inner:
            continue
        mine = [row_of.get(leg.key, -1) for leg in cluster.legs]
        if -1 not in mine:
            rows.append(i)
            mouths += mine
            nodes.append(cluster.legs[0].xy_m[0])
    if not rows:
        return PlaceOutlines((), np.array([], dtype=object))
    count = np.array([len(around.clusters[i].legs) for i in rows])
    at = _Mouths(*(points[mouths] for points in ends))
    outward = at.left + at.right - 2.0 * np.repeat(nodes, count, axis=0)
    turn = np.lexsort(
        (np.arctan2(outward[:, 1], outward[:, 0]), np.repeat(np.arange(len(rows)), count))
    )
    at = _Mouths(*(points[turn] for points in at))
    shapes = shapely.simplify(_polygons(at, count), 0.02, preserve_topology=False)
    fits = shapely.is_valid(shapes) & (shapely.area(shapes) > 1.0)
    place = {around.clusters[i].key: k for k, i in enumerate(rows)}
    fits &= ~_left_by_a_path(shapes, place, connections)
    kept = np.nonzero(fits)[0]
    return PlaceOutlines(tuple(rows[k] for k in kept), shapes[kept])


def _road_ends(lanes: LaneSet) -> tuple[dict[EdgeKey, int], _Mouths]:
    """Return the mouths of all roads, and the row of that at each end of an edge with a place."""
    row_of: dict[EdgeKey, int] = {}
    edges: list[Array] = []
    for road in lanes.roads:
        if not road.lane_ids:
            continue
        edge = lanes.lanes[road.lane_ids[0]].key.edge
        if road.from_place is not None:
            row_of[edge, False] = len(edges)
        if road.to_place is not None:
            row_of[edge, True] = len(edges) + 1
        edges += lanes.edges[road.id]
    lines = Polylines.of(edges)
    xy, first, last = lines.xy_m, lines.first[:-1], lines.first[1:] - 1
    # A road's left edge and its right one; from its end, what was right is left.
    ends, after = np.stack([xy[first], xy[last]], 1), np.stack([xy[first + 1], xy[last - 1]], 1)
    left, right = slice(0, None, 2), slice(1, None, 2)

    def outward(points: Array, start: slice, stop: slice) -> Array:
        return np.stack([points[start, 0], points[stop, 1]], axis=1).reshape(-1, 2)

    return row_of, _Mouths(
        left=outward(ends, left, right),
        left_next=outward(after, left, right),
        right=outward(ends, right, left),
        right_next=outward(after, right, left),
    )


def _polygons(mouths: _Mouths, count: np.ndarray) -> np.ndarray:
    """Return polygons that go from mouth to mouth, round each corner between two kerbs.

    Place k has the next `count[k]` mouths, counter-clockwise.
    """
    first = np.concatenate([[0], np.cumsum(count)])
    after = np.arange(1, first[-1] + 1)
    after[first[1:] - 1] = first[:-1]
    right, a = mouths.right, mouths.left
    u = units(a - mouths.left_next)
    v = units((right - mouths.right_next)[after])
    b = right[after]
    s, t = meeting(a, u, b, v, parallel=PARALLEL)
    meets = np.minimum(s, t) > SHARPEST_CORNER_M
    meets &= (s < FARTHEST_CORNER_M) & (t < FARTHEST_CORNER_M)
    corner = np.where(meets[:, None], a + s[:, None] * u, (a + b) / 2)
    tangent = np.minimum(s, t)[:, None]
    # The widest arc that is tangent to both kerbs, as a rational quadratic Bézier curve.
    begin = np.where(meets[:, None], corner - tangent * u, a)
    end = np.where(meets[:, None], corner - tangent * v, b)
    turned = np.clip(-(u * v).sum(axis=1), -1.0, 1.0)
    weight = np.where(meets, np.sqrt((1.0 + turned) / 2.0), 1.0)[:, None, None]
    w = np.linspace(0.0, 1.0, CORNER_STEPS + 1)[None, :, None]
    p0, p1, p2 = (1 - w) ** 2, 2 * weight * w * (1 - w), w**2
    curve = p0 * begin[:, None] + p1 * corner[:, None] + p2 * end[:, None]
    curve /= p0 + p1 + p2
    # Each mouth gives its right end, its left end and the curve on the way to the next.
    pieces = np.concatenate([right[:, None], a[:, None], curve], axis=1).round(3)
    owner = np.repeat(np.repeat(np.arange(len(count)), count), CORNER_STEPS + 3)
    shapes: np.ndarray = shapely.polygons(shapely.linearrings(pieces.reshape(-1, 2), indices=owner))
    return shapes


def _left_by_a_path(
    shapes: np.ndarray, place: dict[str, int], connections: Sequence[ConnectionDraft]
) -> np.ndarray:
    """Return for each place whether a car on one of its paths would leave the outline."""
    out = np.zeros(len(shapes), dtype=bool)
    mine = [c for c in connections if c.cluster.key in place]
    if not mine:
        return out
    lines = Polylines.of([c.centerline for c in mine])
    which = np.repeat(np.arange(len(mine)), len(SAMPLES))
    at_m = (lines.length_m[:, None] * np.array(SAMPLES)).ravel()
    here = points_at(lines, which, at_m)
    side = left_of(units(points_at(lines, which, at_m + 0.1) - here)) * CAR_HALF_WIDTH_M
    at = np.stack([here + side, here - side], axis=1).reshape(-1, 2)
    owner = np.array([place[c.cluster.key] for c in mine])
    owner = np.repeat(owner, 2 * len(SAMPLES))
    inside = shapely.contains_xy(shapes[owner], at[:, 0], at[:, 1])
    out[owner[~inside]] = True
    return out
