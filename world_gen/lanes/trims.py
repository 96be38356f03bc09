"""How much of each road's lanes gives way to the places where roads meet."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline_batch import Polylines, cut, without_repeats
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.fork_trims import fork_trims
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.lanes.legs import Heads, is_ring_edge
from foretwin.world_gen.lanes.stopping import NodeTags, must_reach_m
from foretwin.world_gen.lanes.tapers import (
    MAX_TRIM_M,
    MOST_WANTED,
    plain_trims,
    tapers_m,
)
from foretwin.world_gen.lanes.turning_room import turning_trims
from foretwin.world_gen.roads.headings import heading_out
from foretwin.world_gen.roads.road_graph import EdgeKey, RoadEdge

CORNER_M = 3.5
"""Room between the kerb of the other road and a lane's end."""
RING_CORNER_M = 1.5
_LEG_LOOK_M = 45.0
_OWN_START_M = 15.0
"""What overlaps a leg farther out belongs to another place, unless it goes on from here."""
MOST_CUT = 0.8
"""Share of an edge that its two ends may take to clear other roads."""


def trims(
    clusters: tuple[Cluster, ...],
    edges: Mapping[int, RoadEdge],
    sections: Mapping[int, CrossSection],
    shifts_m: Mapping[int, tuple[float, float]],
    heads: Heads,
    driven_m: Mapping[EdgeKey, float],
    node_tags: NodeTags,
) -> dict[EdgeKey, float]:
    """Return metres cut off an edge's lanes by (edge index, at its end node).

    `driven_m` are such metres by which cars were seen to have begun to turn.
    """
    least: dict[EdgeKey, float] = {}
    wanted: dict[EdgeKey, float] = {}
    tapers: dict[EdgeKey, float] = {}
    by_size: dict[int, list[tuple[Cluster, Array]]] = {}
    wide = [cluster for cluster in clusters if len(cluster.nodes) > 1]
    areas = dict(zip([c.key for c in wide], _area_trims(wide, edges, sections), strict=True))
    nodes = _node_trims([c for c in clusters if len(c.nodes) == 1], sections, heads)
    for cluster in clusters:
        if cluster.plain:
            values = plain_trims(cluster, sections, shifts_m, heads)
            if values is not None:
                tapers |= tapers_m(cluster, sections, shifts_m, node_tags)
        else:
            values = areas[cluster.key] if len(cluster.nodes) > 1 else nodes[cluster.key]
        driven = np.array([driven_m.get(leg.key, 0.0) for leg in cluster.legs])
        if values is not None or driven.any():
            values = driven if values is None else np.maximum(values, driven)
            by_size.setdefault(len(cluster.legs), []).append((cluster, values))
    for alike in by_size.values():
        mine = [cluster for cluster, _ in alike]
        legs = [leg for cluster in mine for leg in cluster.legs]
        cleared = np.minimum([values for _, values in alike], MAX_TRIM_M)
        lines = [must_reach_m(leg, cl, sections, node_tags) for cl in mine for leg in cl.legs]
        most = np.minimum(np.reshape(lines, cleared.shape), MAX_TRIM_M)
        turning = turning_trims(mine, sections, cleared, most)
        keys = [leg.key for leg in legs]
        least.update(zip(keys, cleared.ravel().tolist(), strict=True))
        wanted.update(zip(keys, turning.ravel().tolist(), strict=True))
    for cluster in clusters:
        for leg in cluster.legs:
            wanted.setdefault(leg.key, 0.0)
    for key, metres in tapers.items():
        wanted[key] = max(wanted[key], metres)
    for key, metres in fork_trims(clusters, sections, heads).items():
        least[key] = max(least.get(key, 0.0), metres)
        wanted[key] = max(wanted[key], metres)
    _share(least, wanted, edges)
    return wanted


def _share(
    least: Mapping[EdgeKey, float],
    wanted: dict[EdgeKey, float],
    edges: Mapping[int, RoadEdge],
) -> None:
    """Let both ends of short edges want no more than leaves a lane between them."""
    for index, edge in edges.items():
        ends = (index, False), (index, True)
        want = [wanted.get(end, 0.0) for end in ends]
        if sum(want) <= MOST_WANTED * edge.length_m:
            continue
        need = [least.get(end, 0.0) for end in ends]
        room = max(MOST_WANTED * edge.length_m, min(sum(need), MOST_CUT * edge.length_m))
        if sum(need) < room:
            share = (room - sum(need)) / (sum(want) - sum(need))
            shared = [n + share * (w - n) for n, w in zip(need, want, strict=True)]
        else:
            shared = [n * room / sum(need) for n in need]
        wanted.update(zip(ends, shared, strict=True))


def _node_trims(
    clusters: list[Cluster], sections: Mapping[int, CrossSection], heads: Heads
) -> dict[str, Array]:
    """Cut each leg where the kerbs of straight legs from one point cross, and a corner more.

    Returns metres (n,) by the key of each cluster.
    """
    by_size: dict[int, list[Cluster]] = {}
    for cluster in clusters:
        if not cluster.plain:
            by_size.setdefault(len(cluster.legs), []).append(cluster)
    found: dict[str, Array] = {}
    for n, alike in by_size.items():
        legs = [leg for cluster in alike for leg in cluster.legs]
        head = np.array([heads[leg.key] for leg in legs]).reshape(-1, n, 2)
        half = np.array([sections[leg.edge.index].half_width_m for leg in legs]).reshape(-1, n)
        on_ring = np.array([is_ring_edge(leg.edge) for leg in legs]).reshape(-1, n)
        cos = np.clip(head @ head.transpose(0, 2, 1), -1.0, 1.0)
        sin = np.sqrt(1.0 - cos * cos)
        reach = (half[:, None, :] + half[:, :, None] * cos) / np.maximum(sin, 0.2)
        # Where the road goes straight on, and with itself, nothing crosses.
        reach = np.where((cos < -0.94) | np.eye(n, dtype=bool), 0.0, reach)
        corner = np.where(on_ring, RING_CORNER_M, CORNER_M)
        trim = np.maximum(reach.max(axis=2), 0.0) + corner
        found.update(zip([c.key for c in alike], trim, strict=True))
    return found


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
