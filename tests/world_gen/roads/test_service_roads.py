"""Service roads and driveways: left alone, unless a route uses them or they are asked for."""

from __future__ import annotations

import pytest

from foretwin.world_gen.connections.lane_connections import connect
from foretwin.world_gen.connections.movements import movements
from foretwin.world_gen.extent import Disc
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.lanes.clusters import surroundings, world_frame
from foretwin.world_gen.lanes.lane_curves import build_lanes
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.service_roads import with_roads, with_service_roads
from tests.world_gen.drawn_maps import AVENUE, STREET, drawn_map

DRIVEWAY = {"highway": "service", "service": "driveway", "access": "private"}


@pytest.fixture
def place():
    osm = drawn_map(
        {
            0: (0.0, 0.0),
            1: (90.0, 0.0),
            2: (0.0, 90.0),
            3: (-90.0, 0.0),
            5: (50.0, 0.0),
            6: (50.0, 30.0),
            7: (-50.0, 0.0),
            8: (-50.0, 30.0),
        },
        [
            (11, [0, 5, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 7, 0], STREET),
            (20, [5, 6], DRIVEWAY),
            (21, [7, 8], {"highway": "service", "service": "parking_aisle", "oneway": "yes"}),
        ],
    )
    return osm, build_road_graph(osm)


def _index(osm, graph):
    return index_map(osm, graph, find_intersections(osm, graph))


def _around(index):
    junction = index.junction_of_node[0]
    return surroundings(index, world_frame(junction), Disc(150.0), (junction,))


def _ways(around) -> set[int]:
    return {lane.edge.way_id for lane in build_lanes(around).lanes.values()}


def test_they_have_no_lanes_unless_asked_for(place):
    osm, graph = place
    assert _ways(_around(_index(osm, graph))) == {11, 12, 13}
    # Where the public may not drive there are none even then.
    assert _ways(_around(_index(osm, with_service_roads(graph)))) == {11, 12, 13, 21}


def test_a_route_opens_the_driveway_that_it_uses(place):
    osm, graph = place
    (driveway,) = (edge.index for edge in graph.edges if edge.way_id == 20)
    around = _around(_index(osm, with_roads(graph, [driveway])))
    assert _ways(around) == {11, 12, 13, 20}
    assert len([k for k in build_lanes(around).lanes.values() if k.edge.way_id == 20]) == 2


def test_a_one_way_aisle_is_only_entered(place):
    osm, graph = place
    index = _index(osm, with_service_roads(graph))
    around = _around(index)
    lanes = build_lanes(around)
    (gate,) = (c for c in around.clusters if 7 in c.nodes)
    found = connect(gate, movements(gate, around, index.restrictions), around, lanes, [])
    assert len([c for c in found if c.end.edge.way_id == 21]) == 2
    assert not [c for c in found if c.start.edge.way_id == 21]
