"""Areas of a World: the carriageway of each road and, between them, of each place where they meet.

Nothing is dissolved into one surface: a region has thousands of pieces, and each is cheap alone.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import msgspec
import numpy as np
import shapely
from shapely.geometry import Polygon

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Area
from foretwin.geometry.polyline_batch import Polylines, cut, offset, without_repeats
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.ground.islands import island_areas
from foretwin.world_gen.ground.kerbs import Paved, kerb_lines
from foretwin.world_gen.ground.place_outlines import simple_outlines
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneSet
from foretwin.world_gen.polygon_areas import GRID_M, areas_of, lines_of, polygons_of_rings

CORNER_FILLET_M = 3.0
SMALLEST_M2 = 0.5
NO_STEP_M = 1e-9
"""Rounding's errors are smaller, and no edge of a road is."""


class Areas(NamedTuple):
    """All areas of a World."""

    road_surface: tuple[Area, ...]
    junction_areas: Mapping[str, Area]
    """By junction id."""
    islands: tuple[Area, ...]
    kerbs: tuple[Array, ...]
    driven: np.ndarray
    """What roads and connections cover, polygon by polygon; nothing solid may stand there."""


def areas(around: Surroundings, lanes: LaneSet, connections: list[ConnectionDraft]) -> Areas:
    """Return the paved areas and what borders them."""
    roads = _road_polygons(lanes)
    simple = simple_outlines(around, lanes, connections)
    outlined = {around.clusters[i].key for i in simple.rows}
    turning = [c for c in connections if c.cluster.key not in outlined]
    swept = _swept(turning)
    rows, shapes = _place_polygons(around, turning, swept, frozenset(simple.rows))
    order = np.argsort([*simple.rows, *rows], kind="stable")
    clusters = tuple(around.clusters[(*simple.rows, *rows)[k]] for k in order)
    places = np.concatenate([simple.polygons, shapes])[order]
    islands, middles = island_areas(around, lanes, Paved(roads, places, clusters))
    if len(middles):
        # Where a turn sweeps over a roundabout's middle, the middle stays.
        hit, which = shapely.STRtree(middles).query(places, predicate="intersects")
        for place, middle in zip(hit, which, strict=True):
            places[place] = shapely.difference(places[place], middles[middle], grid_size=GRID_M)
    paved = Paved(roads, places, clusters)
    of_road, of_place = _surface(paved, lanes)
    return Areas(
        road_surface=(*of_road, *(area for found in of_place for area in found)),
        junction_areas=_junction_areas(around, lanes, paved, of_place),
        islands=islands,
        kerbs=kerb_lines(lanes, paved),
        driven=np.concatenate([roads, simple.polygons, swept]),
    )


def _swept(connections: Sequence[ConnectionDraft]) -> np.ndarray:
    """Return what connections sweep, polygon by polygon."""
    lines = lines_of([c.centerline for c in connections])
    lines = shapely.simplify(lines, 0.03, preserve_topology=False)
    half_m = [c.width_m.value / 2 for c in connections]
    flat = {"cap_style": "flat", "join_style": "mitre", "mitre_limit": 2.0}
    swept: np.ndarray = shapely.buffer(lines, half_m, **flat)
    return swept


def _road_polygons(lanes: LaneSet) -> np.ndarray:
    sides = (lanes.edges[road.id] for road in lanes.roads)
    return polygons_of_rings([np.concatenate([right, left[::-1]]) for left, right in sides])


def _place_polygons(
    around: Surroundings,
    connections: list[ConnectionDraft],
    swept: np.ndarray,
    done: frozenset[int],
) -> tuple[list[int], np.ndarray]:
    """Return what each cluster not `done` covers, and the rows of these clusters.

    That is its stubs, its inner edges and what its turns sweep, corners filled.
    """
    row = {cluster.key: i for i, cluster in enumerate(around.clusters)}
    rings, owners = _stubs_and_inner_edges(around, done)
    discs, disc_owners = _node_discs(around, done)
    pieces = np.concatenate([rings, discs, swept])
    if not len(pieces):
        return [], pieces
    owners += disc_owners
    owners += [row[c.cluster.key] for c in connections]
    order = np.argsort(owners, kind="stable")
    owner = np.asarray(owners)[order]
    used, indices = np.unique(owner, return_inverse=True)
    groups = shapely.geometrycollections(pieces[order], indices=indices)
    whole = shapely.union_all(groups[:, None], axis=1)
    # Mitred outward and rounded inward: corners stay, and only what is filled becomes round.
    closed = shapely.buffer(_grown(whole), -CORNER_FILLET_M, quad_segs=4)
    closed = shapely.set_precision(shapely.simplify(closed, 0.04), GRID_M)
    keep = shapely.area(closed) > SMALLEST_M2
    return used[keep].tolist(), closed[keep]


def _grown(shapes: np.ndarray) -> np.ndarray:
    """Return shapes that reach farther by a fillet on all sides, with mitred corners."""
    mitred = {"join_style": "mitre", "mitre_limit": 2.0}
    with np.errstate(divide="raise", invalid="raise"):
        try:
            grown: np.ndarray = shapely.buffer(shapes, CORNER_FILLET_M, **mitred)
        except FloatingPointError:
            # Where carriageways lie on one another their union may hold points so near to one
            # another that GEOS divides nothing by nothing, and goes a mitre too far there.
            apart = shapely.remove_repeated_points(shapes, NO_STEP_M)
            grown = shapely.buffer(apart, CORNER_FILLET_M, **mitred)
    return grown


def _stubs_and_inner_edges(
    around: Surroundings, done: frozenset[int]
) -> tuple[np.ndarray, list[int]]:
    """Return the carriageways that clusters swallow, and the number of the cluster of each.

    These are the stub of each leg, from its node to where its lanes begin, and all inner edges.
    """
    ways: list[Array] = []
    spans_m: list[tuple[float, float, float]] = []
    owners: list[int] = []
    for i, cluster in enumerate(around.clusters):
        if i in done:
            continue
        for leg in cluster.legs:
            trim = around.trims_m.get(leg.key, 0.0)
            if trim >= 0.05:
                section = around.section(leg)
                left, right = section.left_m, section.right_m
                ways.append(leg.xy_m)
                edges = (-right, -left) if leg.reverse else (left, right)
                spans_m.append((trim + 0.05, *edges))
                owners.append(i)
        for index in sorted(cluster.inner & around.edges.keys()):
            section = around.sections[index]
            ways.append(around.edges[index].xy_m)
            spans_m.append((math.inf, section.left_m, section.right_m))
            owners.append(i)
    if not ways:
        return np.array([], dtype=object), owners
    lines = without_repeats(Polylines.of(ways))
    stop_m, left_m, right_m = np.array(spans_m).T
    lines = cut(lines, np.zeros(len(ways)), np.minimum(stop_m, lines.length_m))
    sides = zip(offset(lines, left_m).split(), offset(lines, right_m).split(), strict=True)
    return polygons_of_rings([np.concatenate([b, a[::-1]]) for a, b in sides]), owners


def _node_discs(around: Surroundings, done: frozenset[int]) -> tuple[np.ndarray, list[int]]:
    """Return a round piece where the legs of a cluster of one node meet at an angle."""
    centres, radii, owners = [], [], []
    for i, cluster in enumerate(around.clusters):
        bent = any(around.trims_m.get(d.key, 0.0) for d in cluster.legs)
        if i in done or not bent or len(cluster.nodes) > 1:
            continue
        halves = sorted(around.section(leg).width_m / 2 for leg in cluster.legs)
        radii.append(halves[-2])
        centres.append(cluster.legs[0].xy_m[0])
        owners.append(i)
    if not centres:
        return np.array([], dtype=object), owners
    return shapely.buffer(shapely.points(np.array(centres)), radii, quad_segs=4), owners


def _surface(paved: Paved, lanes: LaneSet) -> tuple[list[Area], list[list[Area]]]:
    """Return the areas of all roads, and those of each place."""
    names = [f"road:{road.layer}:{road.id}" for road in lanes.roads]
    names += [f"road:{max(leg.edge.layer for leg in c.legs)}:{c.key}" for c in paved.place_of]
    shapes = np.concatenate([paved.roads, paved.places])
    found = areas_of(names, shapes, smallest_m2=SMALLEST_M2)
    count = len(lanes.roads)
    return list(chain.from_iterable(found[:count])), found[count:]


def _junction_areas(
    around: Surroundings, lanes: LaneSet, paved: Paved, of_place: list[list[Area]]
) -> dict[str, Area]:
    """Return for each whole junction its places, and the ring between them, as one area."""
    found: dict[str, Area] = {}
    pieces: dict[str, list[Polygon]] = defaultdict(list)
    for cluster, shape, areas_there in zip(paved.place_of, paved.places, of_place, strict=True):
        if cluster.whole and cluster.junction is not None and areas_there:
            name = cluster.junction.summary.id
            if not cluster.ring and len(cluster.nodes) == len(cluster.junction.nodes):
                found[name] = msgspec.structs.replace(areas_there[0], id=f"junction:{name}")
            else:
                pieces[name].append(shape)
    inner = ((i, junction) for junction in around.junctions for i in junction.inner)
    ring_of: dict[int, Junction] = {i: it for i, it in inner if i in around.ring_edges}
    edge_of = {lane.road_id: lane.key.edge for lane in lanes.lanes.values()}
    for road, shape in zip(lanes.roads, paved.roads, strict=True):
        junction = ring_of.get(edge_of.get(road.id, -1))
        if junction is not None:
            pieces[junction.summary.id].append(shape)
    names = list(pieces)
    whole = np.array([shapely.union_all(pieces[name]) for name in names], dtype=object)
    whole = shapely.set_precision(whole, GRID_M)
    parts = areas_of([f"junction:{name}" for name in names], whole, smallest_m2=SMALLEST_M2)
    return found | {name: mine[0] for name, mine in zip(names, parts, strict=True) if mine}
