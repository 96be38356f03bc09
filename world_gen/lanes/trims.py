"""How much of each road's lanes gives way to the places where roads meet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import Flags
from foretwin.geometry.polyline_batch import Polylines, cut, without_repeats
from foretwin.geometry.turn_curves import LEAD_M, WANTED_RADIUS_M
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.lanes.legs import Heads, heading_out, is_ring_edge, lateral_positions
from foretwin.world_gen.roads.road_graph import RoadEdge

CORNER_M = 3.5
"""Room between the kerb of the other road and a lane's end: makes turns wider than 4 m radius."""
RING_CORNER_M = 1.5
MAX_TRIM_M = 22.0
_LEG_LOOK_M = 45.0
_OWN_START_M = 15.0
"""What overlaps a leg farther out belongs to another place, unless it goes on from here."""
TAPER_M = 6.0
"""Lanes end so far before, and begin so far behind, a place where their number changes."""
SHARPEST_BEND_COS = math.cos(math.radians(75.0))
"""Lanes run on through bends; sharper ones are driven as turns."""
SOFTEST_TURN_RAD, SHARPEST_TURN_RAD = math.radians(20.0), math.radians(150.0)
SHARPEST_ARC_RAD = math.radians(140.0)
"""Sharper turns begin with a swing to the other side instead of farther back."""


class _Legs(NamedTuple):
    """The legs of K clusters that have n legs each; (K, n) or (K, n, 2) arrays."""

    heads: Array
    starts_m: Array
    half_m: Array
    into_m: Array
    """How far the outermost lanes toward the place lie to their drivers' left and right."""
    out_m: Array
    on_ring: Flags


def trims(
    clusters: tuple[Cluster, ...],
    edges: Mapping[int, RoadEdge],
    sections: Mapping[int, CrossSection],
    shifts_m: Mapping[int, tuple[float, float]],
    heads: Heads,
    least_m: Mapping[tuple[int, bool], float],
) -> dict[tuple[int, bool], float]:
    """Return metres cut off an edge's lanes by (edge index, at its end node)."""
    found: dict[tuple[int, bool], float] = {}
    by_size: dict[int, list[Cluster]] = {}
    for cluster in clusters:
        by_size.setdefault(len(cluster.legs), []).append(cluster)
    wide = [cluster for cluster in clusters if len(cluster.nodes) > 1]
    areas = dict(zip([c.key for c in wide], _area_trims(wide, edges, sections), strict=True))
    for alike in by_size.values():
        legs = _legs_of(alike, sections, heads)
        turning, at_node = _turning_trims(legs), _node_trims(legs)
        for k, cluster in enumerate(alike):
            if cluster.plain:
                values = _plain_trims(cluster, legs.heads[k], turning[k], sections, shifts_m)
            elif len(cluster.nodes) == 1:
                values = np.maximum(at_node[k], turning[k])
            else:
                values = np.maximum(areas[cluster.key], turning[k])
            for leg, value in zip(cluster.legs, values.tolist(), strict=True):
                found[leg.key] = min(max(value, least_m.get(leg.key, 0.0)), MAX_TRIM_M)
    for index, edge in edges.items():
        start, end = found.get((index, False), 0.0), found.get((index, True), 0.0)
        room = 0.8 * edge.length_m
        if start + end > room:
            # What is left is shared in proportion, so that a lane of some length remains.
            found[index, False] = start * room / (start + end)
            found[index, True] = end * room / (start + end)
    return found


def _legs_of(clusters: list[Cluster], sections: Mapping[int, CrossSection], heads: Heads) -> _Legs:
    legs = [leg for cluster in clusters for leg in cluster.legs]
    mine = [sections[leg.edge.index] for leg in legs]
    shape = (len(clusters), len(clusters[0].legs))
    into = [s.along(reverse=not leg.reverse).reach_m for s, leg in zip(mine, legs, strict=True)]
    out = [s.along(reverse=leg.reverse).reach_m for s, leg in zip(mine, legs, strict=True)]
    return _Legs(
        heads=np.array([heads[leg.key] for leg in legs]).reshape(*shape, 2),
        starts_m=np.array([leg.xy_m[0] for leg in legs]).reshape(*shape, 2),
        half_m=np.array([section.half_width_m for section in mine]).reshape(shape),
        into_m=np.array(into).reshape(*shape, 2),
        out_m=np.array(out).reshape(*shape, 2),
        on_ring=np.array([is_ring_edge(leg.edge) for leg in legs]).reshape(shape),
    )


def _plain_trims(
    cluster: Cluster,
    heads: Array,
    turning: Array,
    sections: Mapping[int, CrossSection],
    shifts_m: Mapping[int, tuple[float, float]],
) -> Array:
    """Lanes of one road run on where they fit; where lanes change they get room for a taper."""
    first, second = cluster.legs
    a, b = sections[first.edge.index], sections[second.edge.index]
    by_first, by_second = (
        shifts_m.get(leg.edge.index, (0.0, 0.0))[int(leg.reverse)] for leg in cluster.legs
    )
    fits = lateral_positions(first, a, outward=False, shift_m=by_first) == lateral_positions(
        second, b, outward=True, shift_m=by_second
    )
    if fits and -heads[0] @ heads[1] > SHARPEST_BEND_COS:
        return np.zeros(2)
    room = [0.0 if fits else min(TAPER_M, 0.3 * leg.edge.length_m) for leg in cluster.legs]
    return np.maximum(room, turning)


def _node_trims(legs: _Legs) -> Array:
    """Cut each leg where the kerbs of straight legs from one point cross, and a corner more."""
    cos = np.clip(legs.heads @ legs.heads.transpose(0, 2, 1), -1.0, 1.0)
    sin = np.sqrt(1.0 - cos * cos)
    half = legs.half_m
    reach = (half[:, None, :] + half[:, :, None] * cos) / np.maximum(sin, 0.2)
    # Where the road goes straight on, and with itself, nothing crosses.
    reach = np.where((cos < -0.94) | np.eye(half.shape[1], dtype=bool), 0.0, reach)
    corner = np.where(legs.on_ring, RING_CORNER_M, CORNER_M)
    return np.asarray(np.maximum(reach.max(axis=2), 0.0) + corner)


def _turning_trims(legs: _Legs) -> Array:
    """Return (K, n) how far from their node lanes must end for every turn to have its radius.

    A turn by an angle with radius R ends R tan(angle / 2) from where the lanes' lines cross.
    """
    # From leg i into leg j; an angle above 0 is a turn to the left.
    x, y = legs.heads[..., 0], legs.heads[..., 1]
    cos = np.clip(legs.heads @ legs.heads.transpose(0, 2, 1), -1.0, 1.0)
    sin = y[:, :, None] * x[:, None, :] - x[:, :, None] * y[:, None, :]
    angle = np.arctan2(sin, -cos)
    size = np.abs(angle)
    left = angle > 0.0
    start = np.where(left, -legs.into_m[:, :, None, 0], legs.into_m[:, :, None, 1])
    end = np.where(left, -legs.out_m[:, None, :, 0], legs.out_m[:, None, :, 1])
    # To the right of who drives in, and to the left of who drives out.
    aside = np.stack([-y, x], axis=-1)
    gap = legs.starts_m[:, None, :] - legs.starts_m[:, :, None]
    gap = gap - end[..., None] * aside[:, None, :] - start[..., None] * aside[:, :, None]
    across = np.where(np.abs(sin) < 0.2, np.copysign(0.2, sin), sin)
    from_start = (gap[..., 1] * x[:, None, :] - gap[..., 0] * y[:, None, :]) / across
    from_end = (gap[..., 1] * x[:, :, None] - gap[..., 0] * y[:, :, None]) / across
    room = WANTED_RADIUS_M * np.tan(np.minimum(size, SHARPEST_ARC_RAD) / 2.0) + LEAD_M
    turns = (size > SOFTEST_TURN_RAD) & (size < SHARPEST_TURN_RAD)
    from_start = np.where(turns & np.isfinite(from_start), from_start + room, 0.0)
    from_end = np.where(turns & np.isfinite(from_end), from_end + room, 0.0)
    return np.asarray(np.maximum(from_start.max(axis=2), from_end.max(axis=1)))


def _area_trims(
    clusters: list[Cluster], edges: Mapping[int, RoadEdge], sections: Mapping[int, CrossSection]
) -> list[Array]:
    """Cut each leg where it has left the carriageways of all other roads of its cluster."""
    legs = [leg for cluster in clusters for leg in cluster.legs]
    if not legs:
        return []
    ways = without_repeats(Polylines.of([leg.xy_m for leg in legs]))
    ways = cut(ways, np.zeros(len(ways)), np.minimum(ways.length_m, _LEG_LOOK_M))
    lines = shapely.linestrings(ways.xy_m, indices=ways.line)
    widths = [sections[leg.edge.index].half_width_m for leg in legs]
    strips = shapely.buffer(lines, widths, cap_style="flat", quad_segs=4)
    within = [(k, i) for k, c in enumerate(clusters) for i in sorted(c.inner) if i in edges]
    inner = np.array([shapely.LineString(edges[i].xy_m) for _, i in within], dtype=object)
    inner = shapely.buffer(inner, [sections[i].half_width_m for _, i in within], quad_segs=4)
    shapes = np.concatenate([strips, inner])
    heads = np.array([heading_out(leg, 15.0) for leg in legs])
    starts = [leg.start_node for leg in legs]
    pairs: list[tuple[int, int]] = []
    begin = 0
    inside: dict[int, list[int]] = {}
    for row, (k, _) in enumerate(within):
        inside.setdefault(k, []).append(len(legs) + row)
    for k, cluster in enumerate(clusters):
        mine = range(begin, begin + len(cluster.legs))
        begin = mine.stop
        beside = (heads[mine] @ heads[mine].T > 0.85).tolist()
        for i in mine:
            # A leg beside this one, going the same way, is the road's other carriageway.
            pairs += [
                (i, j)
                for j in mine
                if j != i and not (beside[i - mine[0]][j - mine[0]] and starts[i] != starts[j])
            ]
            pairs += [(i, j) for j in inside.get(k, ())]
    reach = np.zeros(len(legs))
    for i, near_m, first_m, last_m in _overlaps(lines, strips, shapes, np.array(pairs)):
        if near_m < _OWN_START_M or first_m <= reach[i]:
            reach[i] = max(reach[i], last_m)
    return np.split(reach + CORNER_M, np.cumsum([len(c.legs) for c in clusters])[:-1])


def _overlaps(
    lines: np.ndarray, strips: np.ndarray, shapes: np.ndarray, pairs: np.ndarray
) -> list[tuple[int, float, float, float]]:
    """Return where legs (pairs[:, 0]) overlap shapes (pairs[:, 1]), in order along each leg.

    Each is the leg's row, the distance from its start, and metres along it of begin and end.
    """
    if not len(pairs):
        return []
    pairs = pairs[shapely.intersects(strips[pairs[:, 0]], shapes[pairs[:, 1]])]
    common = shapely.intersection(strips[pairs[:, 0]], shapes[pairs[:, 1]])
    parts, pair = shapely.get_parts(common, return_index=True)
    large = shapely.area(parts) > 0.05
    parts, leg = parts[large], pairs[pair[large], 0]
    if not len(parts):
        return []
    near_m = shapely.distance(parts, shapely.get_point(lines[leg], 0))
    points, part = shapely.get_coordinates(parts, return_index=True)
    at_m = shapely.line_locate_point(lines[leg[part]], shapely.points(points))
    each = np.searchsorted(part, np.arange(len(parts)))
    first_m, last_m = np.minimum.reduceat(at_m, each), np.maximum.reduceat(at_m, each)
    order = np.lexsort((first_m, leg))
    columns = (column[order].tolist() for column in (leg, near_m, first_m, last_m))
    return list(zip(*columns, strict=True))
