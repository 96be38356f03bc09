"""Lanes reach to where the map has cars stop."""

from __future__ import annotations

import math

import pytest

from foretwin.world_gen.extent import Disc
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.lanes.clusters import surroundings, world_frame
from foretwin.world_gen.lanes.stopping import (
    BEFORE_CROSSING_M,
    CAR_ROOM_M,
    LINE_SETBACK_M,
    clear_of_crossings,
    faces,
    stop_line_m,
)
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, drawn_map

LIGHT = {"highway": "traffic_signals"}


def _lines(tags: dict[int, dict[str, str]]) -> dict[int, float]:
    """Return by way where cars stop that come along it, with nodes 5 and 6 in the west."""
    nodes = CROSS | {5: (-9.0, 0.0), 6: (-14.0, 0.0)}
    ways = [
        (11, [0, 1], STREET),
        (12, [0, 2], AVENUE),
        (13, [3, 6, 5, 0], STREET),
        (14, [4, 0], AVENUE),
    ]
    osm = drawn_map(nodes, ways, node_tags=tags)
    graph = build_road_graph(osm)
    (junction,) = find_intersections(osm, graph)
    index = index_map(osm, graph, (junction,))
    around = surroundings(index, world_frame(junction), Disc(150.0), (junction,))
    return {
        leg.edge.way_id: stop_line_m(leg, cluster, tags)
        for cluster in around.clusters
        for leg in cluster.legs
    }


def test_nothing_tagged_says_nothing():
    assert set(_lines({}).values()) == {math.inf}


def test_the_farthest_light_counts_and_one_for_who_drives_out_does_not():
    forward = LIGHT | {"traffic_signals:direction": "forward"}
    assert _lines({5: LIGHT, 6: forward})[13] == pytest.approx(14.0 - LINE_SETBACK_M)
    backward = LIGHT | {"traffic_signals:direction": "backward"}
    assert _lines({5: forward, 6: backward})[13] == pytest.approx(9.0 - LINE_SETBACK_M)


def test_cars_stop_before_the_crossing_of_a_light():
    crossing = {"highway": "crossing", "crossing": "traffic_signals"}
    lines = _lines({0: LIGHT, 5: crossing})
    assert lines[13] == pytest.approx(12.0 - LINE_SETBACK_M)
    assert lines[11] == math.inf
    assert _lines({5: {"highway": "crossing"}})[13] == math.inf  # nothing stops cars there


def test_a_light_without_a_crossing_stands_at_its_line():
    alone = LIGHT | {"crossing": "no"}
    assert _lines({5: alone})[13] == pytest.approx(9.0 - LINE_SETBACK_M)


def test_the_nearest_sign_counts():
    sign = {"highway": "give_way", "direction": "forward"}
    assert _lines({5: sign, 6: sign})[13] == pytest.approx(9.0 - LINE_SETBACK_M)


def test_a_sign_faces_who_its_tag_says():
    assert faces({"direction": "forward"}, True) is True
    assert faces({"direction": "forward"}, False) is False
    assert faces({"stop:direction": "backward"}, False) is True
    assert faces({}, True) is None


def test_cars_wait_before_a_crossing_that_leaves_no_room_for_one():
    at_m = 10.0
    room_m = at_m - 2.0 - CAR_ROOM_M
    assert clear_of_crossings(room_m - 0.01, [at_m]) == room_m - 0.01
    assert clear_of_crossings(room_m + 0.01, [at_m]) == at_m + BEFORE_CROSSING_M
    assert clear_of_crossings(12.9, [at_m]) == at_m + BEFORE_CROSSING_M
    assert clear_of_crossings(13.1, [at_m]) == 13.1
    # Before it, the next one would be blocked too.
    assert clear_of_crossings(9.0, [17.0, at_m]) == 17.0 + BEFORE_CROSSING_M


def test_a_light_stands_for_crossings_that_are_near():
    assert clear_of_crossings(0.0, [15.0]) == 0.0
    assert clear_of_crossings(0.0, [15.0], served_m=16.0) == 18.0


def test_a_line_stays_where_the_road_begins_before_a_crossing():
    assert clear_of_crossings(4.0, [8.0], most_m=10.9) == 4.0
    assert clear_of_crossings(4.0, [8.0], most_m=11.1) == 11.0
