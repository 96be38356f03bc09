"""The list of a map's junctions as `foretwin intersections` prints it."""

from __future__ import annotations

from contracts.world import IntersectionSummary
from world_gen.find_intersections import find_intersections
from world_gen.osm_map import OsmMap
from world_gen.road_graph import RoadGraph


def intersection_list(osm: OsmMap, graph: RoadGraph) -> list[IntersectionSummary]:
    """Return the summaries of all junctions of a map, sorted by id."""
    return [junction.summary for junction in find_intersections(osm, graph)]
