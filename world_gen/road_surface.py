"""Areas: road surface, kerbs, the junction itself, and the islands it encloses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from contracts.arrays import Array
from contracts.world import Area
from world_gen.clusters import Surroundings, is_ring_edge
from world_gen.connections import ConnectionDraft
from world_gen.lanes import LaneSet
from world_gen.polyline import offset, rounded, without_repeats

CORNER_FILLET_M = 3.0
GRID_M = 0.001
MIN_ISLAND_M2 = 2.5
MAX_ISLAND_M2 = 2500.0
ISLANDS_WITHIN_M = 25.0
RING_ISLAND = "island:ring"
"""Ids of a roundabout's middle begin with this; other islands begin with `island:traffic`."""


class Areas(NamedTuple):
    """All areas of a World."""

    road_surface: tuple[Area, ...]
    junction_area: Area | None
    islands: tuple[Area, ...]
    kerbs: tuple[Array, ...]
    lanes_free: shapely.Geometry
    """What lanes and connections cover; nothing solid may stand there."""


def areas(around: Surroundings, lanes: LaneSet, connections: list[ConnectionDraft]) -> Areas:
    """Return the paved areas and what borders them."""
    disc = shapely.Point(0.0, 0.0).buffer(around.radius_m, quad_segs=32)
    paths = [(lane.centerline, lane.width_m.value) for lane in lanes.lanes.values()]
    paths += [(c.centerline, c.width_m.value) for c in connections]
    swept = shapely.buffer(
        _lines([xy for xy, _ in paths]), [w / 2 for _, w in paths], cap_style="flat", quad_segs=4
    )
    lanes_free = shapely.union_all(swept) if len(swept) else Polygon()
    roads = _carriageways(around)
    paved = shapely.union_all([lanes_free, *roads])
    hull = _junction_hull(around, lanes)
    if hull is not None:
        around_corners = hull.buffer(4.0)
        inside = paved.intersection(around_corners)
        closed = inside.buffer(CORNER_FILLET_M, quad_segs=6).buffer(-CORNER_FILLET_M, quad_segs=6)
        paved = paved.union(closed.intersection(around_corners))
    paved = paved.buffer(0.4, quad_segs=2).buffer(-0.4, quad_segs=2)
    rings = _ring_islands(around, lanes_free)
    for island in rings:
        paved = paved.difference(island)
    # On the millimetre grid on which the World is written, so that rounding breaks nothing.
    paved = shapely.set_precision(shapely.simplify(paved.intersection(disc), 0.04), GRID_M)
    rings = [p for r in rings for p in _sorted(shapely.set_precision(r, GRID_M))]
    islands = [_area(f"{RING_ISLAND}:{i}", island) for i, island in enumerate(rings)]
    islands += _traffic_islands(around, paved, rings)
    return Areas(
        road_surface=tuple(_area(f"road:{i}", p) for i, p in enumerate(_sorted(paved))),
        junction_area=_junction_area(hull, paved),
        islands=tuple(islands),
        kerbs=_kerbs(paved, disc),
        lanes_free=lanes_free,
    )


def _lines(curves: list[Array]) -> shapely.Geometry:
    if not curves:
        return np.array([], dtype=object)
    return shapely.linestrings(
        np.concatenate(curves), indices=np.repeat(np.arange(len(curves)), [len(c) for c in curves])
    )


def _carriageways(around: Surroundings) -> list[shapely.Geometry]:
    """Return each road's carriageway, and a round piece where roads meet at an angle."""
    found = list(
        shapely.buffer(
            _lines([_middle(around, i) for i in around.edges]),
            [around.sections[i].width_m / 2 for i in around.edges],
            cap_style="flat",
            quad_segs=4,
        )
    )
    halves: dict[int, list[float]] = {}
    places: dict[int, Array] = {}
    for index, edge in around.edges.items():
        line = _middle(around, index)
        for node, at in ((edge.start_node, line[0]), (edge.end_node, line[-1])):
            halves.setdefault(node, []).append(around.sections[index].width_m / 2)
            places[node] = at
    for node, widths in sorted(halves.items()):
        if len(widths) >= 2:
            found.append(shapely.Point(places[node]).buffer(sorted(widths)[-2], quad_segs=6))
    return found


def _middle(around: Surroundings, index: int) -> Array:
    section = around.sections[index]
    way = rounded(without_repeats(around.edges[index].xy_m))
    return offset(way, (section.left_m + section.right_m) / 2)


def _junction_hull(around: Surroundings, lanes: LaneSet) -> Polygon | None:
    """Return the convex hull of the main junction's nodes and of the lane ends around them."""
    points: list[Array] = []
    ring = any(c.main and c.ring for c in around.clusters)
    for cluster in around.clusters:
        if not cluster.main:
            continue
        for leg in cluster.legs:
            if ring and leg.edge.index in around.junction.inner:
                points.extend(leg.xy_m)
                continue
            section = around.section(leg)
            for reverse in (False, True):
                outward = reverse == leg.reverse
                directed = type(leg)(leg.edge, reverse)
                plans = section.driven(reverse=reverse)
                ends = (
                    lanes.outgoing(directed, plans) if outward else lanes.incoming(directed, plans)
                )
                for lane in ends:
                    at = lane.centerline[0] if outward else lane.centerline[-1]
                    step = (
                        lane.centerline[1] - lane.centerline[0]
                        if outward
                        else lane.centerline[-1] - lane.centerline[-2]
                    )
                    side = np.array([-step[1], step[0]]) / max(float(np.hypot(*step)), 1e-9)
                    half = lane.width_m.value / 2
                    points.extend([at + half * side, at - half * side])
    if len(points) < 3:
        return None
    hull = shapely.MultiPoint(np.array(points)).convex_hull
    return hull if isinstance(hull, Polygon) and hull.area > 1.0 else None


def _junction_area(hull: Polygon | None, paved: shapely.Geometry) -> Area | None:
    if hull is None:
        return None
    parts = _sorted(shapely.set_precision(hull.intersection(paved), GRID_M))
    return _area("junction", parts[0]) if parts else None


def _ring_islands(around: Surroundings, lanes_free: shapely.Geometry) -> list[Polygon]:
    """Return what rings enclose: the roundabout's middle."""
    rings = [
        shapely.buffer(
            shapely.LineString(_middle(around, i)), around.sections[i].width_m / 2, quad_segs=6
        )
        for i in sorted(around.edges)
        if is_ring_edge(around.edges[i])
    ]
    if not rings:
        return []
    tracks = shapely.union_all(rings)
    found: list[Polygon] = []
    for track in _sorted(tracks):
        for hole in track.interiors:
            middle = Polygon(hole).difference(lanes_free)
            found.extend(p for p in _sorted(middle) if p.area >= MIN_ISLAND_M2)
    return found


def _traffic_islands(
    around: Surroundings, paved: shapely.Geometry, rings: list[Polygon]
) -> list[Area]:
    reach = around.junction.radius_m + ISLANDS_WITHIN_M
    middle = shapely.union_all(rings) if rings else Polygon()
    found: list[Area] = []
    for surface in _sorted(paved):
        for hole in surface.interiors:
            island = Polygon(hole)
            near = island.distance(shapely.Point(0.0, 0.0)) <= reach
            if (
                near
                and MIN_ISLAND_M2 <= island.area <= MAX_ISLAND_M2
                and not island.intersects(middle)
            ):
                found.append(_area(f"island:traffic:{len(found)}", island))
    return found


def _kerbs(paved: shapely.Geometry, disc: Polygon) -> tuple[Array, ...]:
    edge = paved.boundary.difference(disc.boundary.buffer(0.15))
    lines = shapely.get_parts(shapely.line_merge(edge))
    return tuple(np.round(shapely.get_coordinates(line), 3) for line in lines if line.length > 0.5)


def _sorted(shape: shapely.Geometry) -> list[Polygon]:
    """Return the polygons of a shape in a fixed order, largest first."""
    parts = [p for p in shapely.get_parts(shape) if isinstance(p, Polygon) and p.area > 0.5]
    return sorted(parts, key=lambda p: (-round(p.area, 3), p.bounds))


def _area(name: str, polygon: Polygon) -> Area:
    ring = orient(polygon)
    return Area(
        id=name,
        outline=_coordinates(ring.exterior),
        holes=tuple(_coordinates(hole) for hole in ring.interiors),
    )


def _coordinates(ring: shapely.LinearRing) -> Array:
    points: Array = np.round(shapely.get_coordinates(ring)[:-1], 3)
    return points
