"""Where the paths of two connections of one junction meet: the point and the ground they share."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import MITRE_LIMIT, left_of
from foretwin.geometry.polyline_batch import Polylines, directions
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.polygon_areas import rings_of

SWEPT_HALF_WIDTH_M = 1.0
"""Half of what a car sweeps: 1.8 m of body and 0.1 m to each side, whatever the lane's width."""
LEAST_AREA_M2 = 0.3
"""Paths that merely brush each other do not cross; those that end in one lane always meet."""
BESIDE_M = 1.0
"""Neighbouring lanes are drawn no nearer where neither driver leaves the own one."""
PATH_TOLERANCE_M = 0.03
"""Paths have a point each metre; where they meet is known to within this."""
_WORTH_A_THREAD = 1000
"""So many areas take 30 ms: a thread costs little beside them."""
Indices = NDArray[np.int64]


class Meetings(msgspec.Struct, frozen=True, kw_only=True):
    """M pairs of connections, by their indices (M,), `first` before `second`.

    `merging` (M,) is whether both end in one lane; `points` (M, 2) is where their middles cross
    or come nearest, each of `areas` (N, 2) a counter-clockwise outline. `first_m` and
    `second_m` (M,) are how far along each path the point lies, `apart_m` (M,)
    how far the middles stay from each other.
    """

    first: Indices
    second: Indices
    merging: NDArray[np.bool_]
    points: Array
    areas: tuple[Array, ...]
    first_m: Array
    second_m: Array
    apart_m: Array


def meetings(connections: Sequence[ConnectionDraft]) -> Meetings:
    """Return every pair of connections of one junction and one level whose swept areas overlap.

    Two that begin in one lane part and do not meet; of two that follow each other neither waits.
    Two out of lanes of one road whose middles stay a metre apart keep beside each other.
    """
    lines, swept = _swept(connections)
    a, b = shapely.STRtree(swept).query(swept)
    junction = np.array([id(c.cluster.junction) for c in connections])
    number: dict[str, int] = {}
    start = np.array([number.setdefault(c.start.id, len(number)) for c in connections])
    end = np.array([number.setdefault(c.end.id, len(number)) for c in connections])
    near = (a < b) & (junction[a] == junction[b]) & (start[a] != start[b])
    near &= (end[a] != start[b]) & (end[b] != start[a])
    a, b = a[near], b[near]
    # Most neighbours do not touch: prepared geometries find that in a tenth of the time.
    shapely.prepare(swept)
    near = end[a] == end[b]
    near[~near] = shapely.intersects(swept[a[~near]], swept[b[~near]])
    a, b = a[near], b[near]
    merging = end[a] == end[b]
    shared = _intersections(swept[a], swept[b])
    meet = merging | (shapely.area(shared) >= LEAST_AREA_M2)
    meet[meet] = _on_one_level(connections, a[meet], b[meet])
    road = np.array([c.start.key.edge for c in connections])
    beside = meet & ~merging & (road[a] == road[b])
    apart_m = shapely.distance(lines[a[beside]], lines[b[beside]])
    meet[beside] = apart_m < BESIDE_M
    a, b, merging, shared = a[meet], b[meet], merging[meet], shared[meet]
    order = np.lexsort((b, a))
    a, b, merging, shared = a[order], b[order], merging[order], shared[order]
    nearest = shapely.get_coordinates(shapely.shortest_line(lines[a], lines[b]))
    ends = nearest.reshape(-1, 2, 2)
    middle = ends.mean(axis=1)
    points = np.round(middle, 3)
    at = shapely.points(middle)
    return Meetings(
        first=a,
        second=b,
        merging=merging,
        points=points,
        areas=_outlines(shared, points),
        first_m=shapely.line_locate_point(lines[a], at),
        second_m=shapely.line_locate_point(lines[b], at),
        apart_m=np.hypot(*(ends[:, 1] - ends[:, 0]).T),
    )


def _intersections(one: Array, other: Array) -> Array:
    """Return what each two of P areas share, on two processors where they are many."""
    if len(one) < _WORTH_A_THREAD:
        return np.asarray(shapely.intersection(one, other))
    half = len(one) // 2
    with ThreadPoolExecutor(1) as beside:
        rest = beside.submit(shapely.intersection, one[half:], other[half:])
        return np.concatenate([shapely.intersection(one[:half], other[:half]), rest.result()])


def _on_one_level(
    connections: Sequence[ConnectionDraft], a: Indices, b: Indices
) -> NDArray[np.bool_]:
    """Return (M,) whether the paths share a node of the map or run at one level somewhere.

    A bridge often begins at the very node of a junction, so levels alone do not decide.
    """
    layer = np.array([c.start.edge.layer for c in connections])
    alike: NDArray[np.bool_] = layer[a] == layer[b]
    for pair in np.nonzero(~alike)[0].tolist():
        one, other = connections[a[pair]], connections[b[pair]]
        alike[pair] = bool(_layers(one) & _layers(other) or _nodes(one) & _nodes(other))
    return alike


def _layers(c: ConnectionDraft) -> set[int]:
    edges = [c.start.edge, c.end.edge, *(part.edge for part in c.movement.inside)]
    return {edge.layer for edge in edges}


def _nodes(c: ConnectionDraft) -> set[int]:
    passed = {part.end_node for part in c.movement.inside}
    return passed | {c.movement.toward.end_node, c.movement.away.start_node}


def _outlines(shared: Array, points: Array) -> tuple[Array, ...]:
    """Return the outline of the largest part of each area, counter-clockwise."""
    whole = shapely.get_type_id(shared) == shapely.GeometryType.POLYGON
    whole &= ~shapely.is_empty(shared)
    torn = np.nonzero(~whole)[0]
    pieces, of = shapely.get_parts(shared[torn], return_index=True)
    polygons = shapely.get_type_id(pieces) == shapely.GeometryType.POLYGON
    parts = np.concatenate([shared[whole], pieces[polygons]])
    owner = np.concatenate([np.nonzero(whole)[0], torn[of[polygons]]])
    order = np.lexsort((shapely.area(parts), owner))
    owner = owner[order]
    largest = np.append(owner[1:] != owner[:-1], True) if len(owner) else np.zeros(0, dtype=bool)
    outlines = rings_of(parts[order][largest])
    found = {i: outline for i, (outline, *_) in zip(owner[largest].tolist(), outlines, strict=True)}
    corner = 0.1 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    # Paths that end in one point but are too short to sweep anything still need an outline.
    return tuple(
        found[i] if i in found else np.round(point + corner, 3) for i, point in enumerate(points)
    )


def _swept(connections: Sequence[ConnectionDraft]) -> tuple[Array, Array]:
    """Return the middle lines and what a car sweeps along them, as arrays of geometries.

    Vertices move out along the mean normal of their two segments. Where a bend is too sharp for
    that the area is a buffer, which is slower.
    """
    paths = Polylines.of([c.centerline for c in connections])
    lines = shapely.linestrings(paths.xy_m, indices=paths.line)
    lines = shapely.simplify(lines, PATH_TOLERANCE_M, preserve_topology=False)
    xy, owner = shapely.get_coordinates(lines, return_index=True)
    first = np.searchsorted(owner, np.arange(len(lines) + 1))
    arriving, leaving = directions(Polylines(xy, first))
    normal = left_of(arriving + leaving)
    norm2 = (normal * normal).sum(axis=1)
    # |in + out| = 2 cos(bend / 2), and the mitre is 1 / cos(bend / 2) long.
    normal *= (2.0 / np.maximum(norm2, 4.0 / MITRE_LIMIT**2))[:, None] * SWEPT_HALF_WIDTH_M
    outline = np.empty((2 * len(xy), 2))
    at = np.arange(len(xy)) + first[owner]
    outline[at] = xy - normal
    outline[2 * (first[:-1] + first[1:])[owner] - 1 - at] = xy + normal
    swept = shapely.polygons(shapely.linearrings(outline, indices=np.repeat(owner, 2)))
    bad = ~shapely.is_valid(swept)
    if bad.any():
        swept[bad] = shapely.buffer(lines[bad], SWEPT_HALF_WIDTH_M, cap_style="flat", quad_segs=2)
    return lines, swept
