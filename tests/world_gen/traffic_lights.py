"""What every traffic light of a map is there for: a junction, a crossing on foot, the road."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import msgspec

from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.road_tags import is_car_road

LightRole = Literal["junction", "pedestrians", "road"]
"""`road`: drivers stop for it, but not at a junction for cars that the map holds.

It guards a narrow place, works, a tunnel, a road closed to cars, or a junction of which the map
holds but one arm.
"""


class TrafficLight(msgspec.Struct, frozen=True, kw_only=True):
    """A node tagged `highway=traffic_signals` on a car road, and the junctions that it governs."""

    osm_node: int
    role: LightRole
    junction_ids: tuple[str, ...] = ()


def traffic_lights(osm: OsmMap, junctions: Iterable[Junction]) -> tuple[TrafficLight, ...]:
    """Return every traffic light on car roads once, by node; `junctions` are all of the map's."""
    governs: dict[int, list[str]] = {}
    for junction in junctions:
        for node in junction.lights:
            governs.setdefault(node, []).append(junction.summary.id)
    lights = {
        node for node, tags in osm.node_tags.items() if tags.get("highway") == "traffic_signals"
    }
    on_roads = {
        node
        for way in osm.ways.values()
        if is_car_road(way.tags)
        for node in way.nodes
        if node in lights
    }
    found = []
    for node in sorted(on_roads):
        tags = osm.node_tags[node]
        ids = tuple(sorted(governs.get(node, ())))
        on_foot = "crossing" in tags or tags.get("traffic_signals") == "pedestrian_crossing"
        role: LightRole = "junction" if ids else "pedestrians" if on_foot else "road"
        found.append(TrafficLight(osm_node=node, role=role, junction_ids=ids))
    return tuple(found)
