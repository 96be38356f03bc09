"""Small maps drawn in metres, for tests that say what a World must look like."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence

import numpy as np

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.osm_map import (
    LatLonBounds,
    NodeLocations,
    OsmMap,
    OsmMember,
    OsmRelation,
    OsmWay,
)
from foretwin.world_gen.roads.build_graph import build_road_graph

GERMANY, IRELAND = GeoPoint(52.0, 10.0), GeoPoint(53.0, -8.0)
"""Lanes of both are equally wide, so that a World of one is the other's, mirrored."""
Tags = Mapping[str, str]


def drawn_map(
    nodes: Mapping[int, tuple[float, float]],
    ways: Sequence[tuple[int, Sequence[int], Tags]],
    *,
    relations: Sequence[tuple[int, Sequence[tuple[str, int, str]], Tags]] = (),
    node_tags: Mapping[int, Tags] | None = None,
    origin: GeoPoint = GERMANY,
) -> OsmMap:
    """Return a map whose `nodes` are metres east and north of `origin`."""
    frame = LocalFrame(origin)
    geo = geo_from_local(frame, np.array(list(nodes.values()), dtype=np.float64))
    order = np.argsort(np.array(list(nodes)))
    locations = NodeLocations(np.array(list(nodes), dtype=np.int64)[order], geo[order])
    return OsmMap(
        attribution=ATTRIBUTION,
        file="drawn.osm",
        sha256=hashlib.sha256(repr((nodes, ways, relations, node_tags)).encode()).hexdigest(),
        bounds=LatLonBounds(*geo.min(axis=0), *geo.max(axis=0)),
        frame=frame,
        locations=locations,
        node_tags=node_tags or {},
        ways={i: OsmWay(i, tuple(members), tags) for i, members, tags in ways},
        relations={
            i: OsmRelation(i, tuple(OsmMember(*m) for m in members), tags)
            for i, members, tags in relations
        },
    )


def world_of(osm: OsmMap, *, radius_m: float = 150.0) -> World:
    """Return the World of the map's only junction."""
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    assert len(junctions) == 1, [j.summary for j in junctions]
    return build_world(osm, graph, junctions[0], radius_m=radius_m)


CROSS = {0: (0.0, 0.0), 1: (100.0, 0.0), 2: (0.0, 100.0), 3: (-100.0, 0.0), 4: (0.0, -100.0)}
"""Node 0 in the middle; 1, 2, 3, 4 are 100 m to its east, north, west and south."""
STREET: Tags = {"highway": "residential", "name": "Street"}
AVENUE: Tags = {"highway": "residential", "name": "Avenue"}


def crossing(
    *,
    street: Tags = STREET,
    avenue: Tags = AVENUE,
    relations: Sequence[tuple[int, Sequence[tuple[str, int, str]], Tags]] = (),
    node_tags: Mapping[int, Tags] | None = None,
    extra_nodes: Mapping[int, tuple[float, float]] | None = None,
    extra_ways: Sequence[tuple[int, Sequence[int], Tags]] = (),
    origin: GeoPoint = GERMANY,
) -> OsmMap:
    """Return Street (ways 13 from the west, 11 to the east) across Avenue (14 south, 12 north)."""
    return drawn_map(
        CROSS | dict(extra_nodes or {}),
        [
            (11, [0, 1], street),
            (12, [0, 2], avenue),
            (13, [3, 0], street),
            (14, [4, 0], avenue),
            *extra_ways,
        ],
        relations=relations,
        node_tags=node_tags,
        origin=origin,
    )


def roundabout(
    *, origin: GeoPoint = GERMANY, clockwise: bool = False, radius_m: float = 15.0
) -> OsmMap:
    """Return a roundabout with arms to the east, north and west."""
    angles = np.arange(24) * (2 * math.pi / 24) * (-1 if clockwise else 1)
    points = radius_m * np.cos(angles), radius_m * np.sin(angles)
    ring = {100 + i: (x, y) for i, (x, y) in enumerate(zip(*points, strict=True))}
    north = 118 if clockwise else 106
    nodes = ring | {1: (100.0, 0.0), 2: (0.0, 100.0), 3: (-100.0, 0.0)}
    return drawn_map(
        nodes,
        [
            (10, [*ring, 100], {"highway": "tertiary", "junction": "roundabout"}),
            (11, [100, 1], {"highway": "tertiary", "name": "East"}),
            (12, [north, 2], {"highway": "tertiary", "name": "North"}),
            (13, [112, 3], {"highway": "tertiary", "name": "West"}),
        ],
        origin=origin,
    )
