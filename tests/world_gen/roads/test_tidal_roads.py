"""Tidal roads: their parts lead one into another, as a route drives them or as most are drawn."""

from __future__ import annotations

from collections.abc import Collection

import pytest

from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import RoadGraph
from foretwin.world_gen.roads.tidal_roads import with_tides
from tests.world_gen.drawn_maps import drawn_map

EXPRESS = {"highway": "motorway", "oneway": "reversible", "lanes": "3"}
RAMP = {"highway": "motorway_link", "oneway": "reversible", "lanes": "1"}

#  3 ──31──> 1 <──32── 0     most metres of the express lanes are drawn to the east; a ramp, drawn
#              <─33── 2      towards them, leaves them for the east
NODES = {3: (-500.0, 0.0), 1: (0.0, 0.0), 0: (300.0, 0.0), 2: (150.0, -40.0)}


def express(*, ramp: dict[str, str] = RAMP) -> OsmMap:
    return drawn_map(NODES, [(31, [3, 1], EXPRESS), (32, [0, 1], EXPRESS), (33, [2, 1], ramp)])


def eastward(graph: RoadGraph) -> dict[int, tuple[bool, bool]]:
    """By way, whether cars drive it to the east and to the west."""
    return {
        edge.way_id: (edge.forward, edge.backward)
        if edge.xy_m[0, 0] < edge.xy_m[-1, 0]
        else (edge.backward, edge.forward)
        for edge in graph.edges
    }


def key_of(graph: RoadGraph, way: int, *, reverse: bool) -> tuple[int, bool]:
    (index,) = (edge.index for edge in graph.edges if edge.way_id == way)
    return index, reverse


def test_parts_drawn_head_to_head_lead_one_into_another():
    graph = with_tides(build_road_graph(express()))

    assert eastward(graph) == dict.fromkeys((31, 32, 33), (True, False))
    assert {(e.lanes_forward.value, e.lanes_backward.value) for e in graph.edges} == {
        (3.0, 0.0), (0.0, 3.0), (0.0, 1.0),
    }  # fmt: skip
    assert [leg.edge for leg in graph.at_node(1)] == [graph.edges[i] for i in (0, 1, 2)]


@pytest.mark.parametrize(("way", "reverse"), [(31, True), (32, False), (33, False)])
def test_all_of_it_runs_as_a_route_drives_a_part(way: int, reverse: bool):
    graph = build_road_graph(express())

    found = with_tides(graph, [key_of(graph, way, reverse=reverse)])

    assert eastward(found) == dict.fromkeys((31, 32, 33), (False, True))


def test_lanes_that_are_told_for_each_way_round_stay():
    each_way = {**RAMP, "lanes": "2", "lanes:forward": "1", "lanes:backward": "1"}

    graph = with_tides(build_road_graph(express(ramp=each_way)))

    assert eastward(graph) == {31: (True, False), 32: (True, False), 33: (True, True)}


@pytest.mark.parametrize("oneway", ["alternating", "no"])
def test_what_changes_every_few_minutes_is_driven_both_ways(oneway: str):
    bridge = {"highway": "residential", "oneway": oneway}
    graph = build_road_graph(drawn_map(NODES, [(31, [3, 1, 0], bridge)]))

    assert with_tides(graph) is graph
    assert eastward(graph) == {31: (True, True)}


def test_two_that_cross_say_nothing_of_each_other():
    nodes = {0: (0.0, 0.0), 1: (90.0, 0.0), 2: (-90.0, 0.0), 3: (0.0, 90.0), 4: (0.0, -90.0)}
    ways = [(31, [2, 0, 1], EXPRESS), (32, [4, 0, 3], EXPRESS)]
    graph = build_road_graph(drawn_map(nodes, ways))
    down = next(e.index for e in graph.edges if e.way_id == 32)

    found = with_tides(graph, [(down, True)])

    assert {(e.way_id, e.forward) for e in found.edges} == {(31, True), (32, False)}


def _world(osm: OsmMap, graph: RoadGraph):
    junctions = find_intersections(osm, graph)
    index = index_map(osm, graph, junctions)
    return index.map_key, build_world(osm, graph, junctions[0], index=index)


def _notes(notes: Collection[str]) -> set[str]:
    return {note.partition("; here ")[2] for note in notes if "one way at a time" in note}


def test_a_world_has_lanes_one_way_and_says_that_it_guessed():
    osm = express()
    read = build_road_graph(osm)
    west = with_tides(read, [key_of(read, 32, reverse=False)])
    keys, worlds = zip(
        *(_world(osm, graph) for graph in (read, with_tides(read), west)), strict=True
    )

    assert len(set(keys)) == 3  # none is taken from the cache for another
    assert {w.intersection.kind for w in worlds[1:]} == {"merge"}
    rules = [{conflict.rule for conflict in world.conflicts} for world in worlds]
    assert rules == [{"turn_across", "lesser_road"}, set(), {"lesser_road"}]
    lanes = [{(lane.osm_way, lane.reverse) for lane in world.lanes} for world in worlds]
    assert lanes[1] == {(31, False), (32, True), (33, True)}
    assert lanes[2] == {(31, True), (32, False), (33, False)}
    assert {lane.direction_source for lane in worlds[1].lanes} == {"default"}
    assert [_notes(world.notes) for world in worlds] == [
        {"both ways"}, {"along its nodes", "against its nodes"},
        {"along its nodes", "against its nodes"},
    ]  # fmt: skip
