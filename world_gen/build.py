"""From a junction of a map to its World: the one entry to world generation."""

from __future__ import annotations

import hashlib

import msgspec
import numpy as np

from contracts.codec import content_bytes
from contracts.world import Arm, World
from world_gen.approaches import approaches
from world_gen.buildings import buildings_in_frame
from world_gen.clusters import Surroundings, surroundings
from world_gen.connections import ConnectionDraft, connect
from world_gen.crossings import crossings
from world_gen.intersections import Junction
from world_gen.lanes import LaneSet, build_lanes, join_straight_on
from world_gen.map_index import MapIndex, index_map
from world_gen.movements import movements
from world_gen.osm_map import OsmMap
from world_gen.right_of_way import add_right_of_way
from world_gen.road_graph import RoadGraph
from world_gen.road_surface import areas
from world_gen.stop_lines import line_controls, signals, stop_lines

GENERATOR_VERSION = 2
"""Counts changes of what is built from the same map; part of every cache key."""
DEFAULT_RADIUS_M = 150.0


def build_world(
    osm: OsmMap,
    graph: RoadGraph,
    junction: Junction,
    *,
    radius_m: float = DEFAULT_RADIUS_M,
    index: MapIndex | None = None,
) -> World:
    """Build the World within `radius_m` of a junction, in the junction's own frame.

    What cannot be built is left out and named in the World's notes. Pass an `index` (see
    `index_map`) where many Worlds come from one map: making it takes longer than one World.
    Raises ValueError where the radius is not between 10 and 2000 m.
    """
    if not 10.0 <= radius_m <= 2000.0:
        raise ValueError(f"radius {radius_m} m is not between 10 and 2000 m")
    index = index or index_map(osm, graph, (junction,))
    notes: list[str] = []
    around = surroundings(index, junction, radius_m)
    lanes = build_lanes(around)
    connections = _connections(index, around, lanes, notes)
    found = approaches(around, osm.node_tags)
    lines = stop_lines(found, around, lanes)
    controls = line_controls(lines)
    for connection in connections:
        connection.control = controls.get(connection.start.id, "none")
    add_right_of_way([c for c in connections if c.cluster.main], around.driving_side)
    surface = areas(around, lanes, connections)
    near = index.buildings_within(np.asarray(junction.centre_xy_m), radius_m)
    buildings, cut = buildings_in_frame(near, around.frame, graph.frame, surface.lanes_free)
    world = World(
        id="",
        intersection=junction.summary,
        frame=around.frame,
        radius_m=radius_m,
        map_sha256=osm.sha256,
        arms=_arms(around, lanes),
        lanes=tuple(lane.finished() for lane in lanes.lanes.values()),
        connections=tuple(c.finished() for c in connections),
        stop_lines=lines,
        crossings=crossings(around, osm.node_tags),
        signals=signals(found, lines, around, lanes),
        islands=surface.islands,
        kerbs=surface.kerbs,
        road_surface=surface.road_surface,
        junction_area=surface.junction_area,
        buildings=buildings,
        notes=tuple(dict.fromkeys((*lanes.notes, *notes, *cut))),
        attribution=osm.attribution,
    )
    return with_id(world)


def with_id(world: World) -> World:
    """Return the World with the id that its content has: 16 hex digits of a SHA-256."""
    nameless = msgspec.structs.replace(world, id="")
    digest = hashlib.sha256(content_bytes(nameless)).hexdigest()
    return msgspec.structs.replace(nameless, id=digest[:16])


def _connections(
    index: MapIndex, around: Surroundings, lanes: LaneSet, notes: list[str]
) -> list[ConnectionDraft]:
    found: list[ConnectionDraft] = []
    for cluster in around.clusters:
        if join_straight_on(cluster, around, lanes):
            continue
        ways = movements(cluster, around, index.restrictions)
        found.extend(connect(cluster, ways, around, lanes, notes))
    return found


def _arms(around: Surroundings, lanes: LaneSet) -> tuple[Arm, ...]:
    arms = []
    for i, arm in enumerate(around.junction.arms):
        lanes_in = lanes_out = 0
        for leg in arm.outward:
            section = around.sections.get(leg.edge.index)
            if section is not None:
                lanes_out += len(section.driven(reverse=leg.reverse))
                lanes_in += len(section.driven(reverse=not leg.reverse))
        arms.append(
            Arm(
                id=f"a{i}",
                name=arm.name,
                osm_ways=tuple(dict.fromkeys(leg.edge.way_id for leg in arm.outward)),
                bearing_rad=float(arm.bearing_rad),
                lanes_in=lanes_in,
                lanes_out=lanes_out,
            )
        )
    return tuple(arms)
