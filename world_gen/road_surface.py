"""Areas: road surface, kerbs, the junction itself, and the islands it encloses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from contracts.arrays import Array
from contracts.frames import local_from_geo
from contracts.world import Area
from world_gen.clusters import Cluster, Surroundings, is_ring_edge
from world_gen.connections import ConnectionDraft
from world_gen.intersections import Junction
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
    junction_areas: Mapping[str, Area]
    """By junction id."""
    islands: tuple[Area, ...]
    kerbs: tuple[Array, ...]
    lanes_free: shapely.Geometry
    """What lanes and connections cover; nothing solid may stand there."""


def areas(around: Surroundings, lanes: LaneSet, connections: list[ConnectionDraft]) -> Areas:
    """Return the paved areas and what borders them."""
    disc = around.extent.polygon
    paths = [(lane.centerline, lane.width_m.value) for lane in lanes.lanes.values()]
    paths += [(c.centerline, c.width_m.value) for c in connections]
    swept = shapely.buffer(
        _lines([xy for xy, _ in paths]), [w / 2 for _, w in paths], cap_style="flat", quad_segs=4
    )
    lanes_free = shapely.union_all(swept) if len(swept) else Polygon()
    roads = _carriageways(around)
    paved = shapely.union_all([lanes_free, *roads])
    hulls = _junction_hulls(around, lanes)
    if hulls:
        around_corners = shapely.union_all([hull.buffer(4.0) for hull in hulls.values()])
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
        junction_areas=_junction_areas(hulls, paved),
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


def _junction_hulls(around: Surroundings, lanes: LaneSet) -> dict[str, Polygon]:
    """Return by junction id the convex hull of its nodes and of the lane ends around them."""
    found: dict[str, Polygon] = {}
    for junction in around.junctions:
        mine = [c for c in around.clusters if c.whole and c.junction is junction]
        points = _lane_corners(mine, junction, around, lanes)
        if len(points) >= 3:
            hull = shapely.MultiPoint(np.array(points)).convex_hull
            if isinstance(hull, Polygon) and hull.area > 1.0:
                found[junction.summary.id] = hull
    return found


def _lane_corners(
    clusters: list[Cluster], junction: Junction, around: Surroundings, lanes: LaneSet
) -> list[Array]:
    points: list[Array] = []
    ring = any(c.ring for c in clusters)
    for cluster in clusters:
        for leg in cluster.legs:
            if ring and leg.edge.index in junction.inner:
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
    return points


def _junction_areas(hulls: Mapping[str, Polygon], paved: shapely.Geometry) -> dict[str, Area]:
    found: dict[str, Area] = {}
    shapely.prepare(paved)
    for name, hull in hulls.items():
        parts = _sorted(shapely.set_precision(hull.intersection(paved), GRID_M))
        if parts:
            found[name] = _area(f"junction:{name}", parts[0])
    return found


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
    places = shapely.points([_centre(j, around) for j in around.junctions])
    near = shapely.buffer(places, [j.radius_m + ISLANDS_WITHIN_M for j in around.junctions])
    reach = shapely.union_all(near)
    shapely.prepare(reach)
    middle = shapely.union_all(rings) if rings else Polygon()
    found: list[Area] = []
    for surface in _sorted(paved):
        for hole in surface.interiors:
            island = Polygon(hole)
            if (
                reach.intersects(island)
                and MIN_ISLAND_M2 <= island.area <= MAX_ISLAND_M2
                and not island.intersects(middle)
            ):
                found.append(_area(f"island:traffic:{len(found)}", island))
    return found


def _centre(junction: Junction, around: Surroundings) -> Array:
    here = junction.summary
    return local_from_geo(around.frame, here.lat, here.lon)


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
