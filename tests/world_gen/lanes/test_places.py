"""Which junctions lie whole in a World."""

from __future__ import annotations

import pytest

from foretwin.contracts.world import World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import STREET, crossing


def with_fork_in_the_east(radius_m: float) -> World:
    """The World of a crossing whose Street parts 100 m to the east."""
    osm = crossing(
        extra_nodes={5: (200.0, 0.0), 6: (190.0, 60.0)},
        extra_ways=[(15, [1, 5], STREET), (16, [1, 6], {"highway": "residential", "name": "Way"})],
    )
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    middle = next(j for j in junctions if j.summary.id == "n0")
    index = index_map(osm, graph, junctions)
    return build_world(osm, graph, middle, radius_m=radius_m, index=index)


@pytest.mark.parametrize(("radius_m", "whole"), [(150.0, ["n0", "n1"]), (102.0, ["n0"])])
def test_a_junction_that_no_road_leads_through_before_the_edge_is_not_whole(
    radius_m: float, whole: list[str]
) -> None:
    world = with_fork_in_the_east(radius_m)
    assert [junction.summary.id for junction in world.junctions] == whole
    assert {c.junction_id for c in world.connections} == set(whole)
    led = {c.from_lane_id for c in world.connections}
    assert {lane.id for lane in world.lanes if lane.role == "approach"} <= led
    assert {line.lane_id for line in world.stop_lines} <= led
