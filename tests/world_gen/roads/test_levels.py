"""A tunnel and the street above it share a node in some maps, and no junction."""

from __future__ import annotations

import pytest

from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import CROSS, STREET, Tags, drawn_map

TUNNEL: Tags = {**STREET, "name": "Below", "tunnel": "yes", "layer": "-1"}
BRIDGE: Tags = {**STREET, "name": "Above", "bridge": "yes", "layer": "1"}


def passing(tags: Tags, *, others: Tags = STREET) -> OsmMap:
    """Return a way from west to east, and one from south to north, through node 9; the way meets
    a side road far to the west."""
    nodes = {**CROSS, 9: (0.0, 0.0), 5: (-100.0, 50.0), 6: (-200.0, 0.0)}
    del nodes[0]
    ways = [(11, (6, 3, 9, 1), others), (12, (4, 9, 2), tags), (13, (3, 5), STREET)]
    return drawn_map(nodes, ways)


@pytest.mark.parametrize("tags", [TUNNEL, BRIDGE])
def test_a_node_within_both_ways_joins_no_levels(tags: Tags) -> None:
    osm = passing(tags)
    graph = build_road_graph(osm)
    assert graph.passed_over == {9}
    assert [e.node_ids for e in graph.edges] == [(6, 3), (3, 9, 1), (4, 9, 2), (3, 5)]
    (junction,) = find_intersections(osm, graph)
    assert junction.summary.id == "n3"
    world = build_world(osm, graph, junction)
    assert {lane.osm_way for lane in world.roads} == {11, 12, 13}
    assert "node 9: in the map two roads of different levels meet; taken as apart" in world.notes
    assert not [c for c in world.connections if "w12" in c.from_lane_id + c.to_lane_id]


@pytest.mark.parametrize(
    ("tags", "others"),
    [
        (TUNNEL, TUNNEL),  # a junction underground
        (STREET, STREET),
        ({**STREET, "layer": "1"}, STREET),  # neither is a bridge or a tunnel
    ],
)
def test_a_node_within_both_ways_joins_one_level(tags: Tags, others: Tags) -> None:
    graph = build_road_graph(passing(tags, others=others))
    assert graph.passed_over == frozenset()
    assert len(graph.at_node(9)) == 4


def test_a_tunnel_that_ends_at_a_street_meets_it() -> None:
    ways = [(11, (3, 9, 1), STREET), (12, (4, 9), TUNNEL)]
    graph = build_road_graph(drawn_map({**CROSS, 9: (0.0, 0.0)}, ways))
    assert len(graph.at_node(9)) == 3


def test_where_a_third_road_goes_on_all_meet() -> None:
    ways = [(11, (3, 9, 1), STREET), (12, (4, 9, 2), TUNNEL), (13, (9, 5), STREET)]
    graph = build_road_graph(drawn_map({**CROSS, 9: (0.0, 0.0), 5: (50.0, 50.0)}, ways))
    assert len(graph.at_node(9)) == 5
