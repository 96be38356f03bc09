"""Turn restrictions: which of a relation's words hold for cars, and where they lead."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.turn_restrictions import read_turn_restrictions
from tests.world_gen.drawn_maps import crossing, drawn_map, world_of

FROM_WEST = ("w", 13, "from")
VIA = ("n", 0, "via")
WAYS = (13, 12, 21, 22, 23, 31, 32)


def _leaving_west(tags, ends=(12,)) -> set[int]:
    members = [FROM_WEST, VIA, *(("w", end, "to") for end in ends)]
    world = world_of(crossing(relations=[(1, members, {"type": "restriction", **tags})]))
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    return {way_of[c.to_lane_id] for c in world.connections if way_of[c.from_lane_id] == 13}


@pytest.mark.parametrize(
    ("tags", "reached"),
    [
        ({"restriction": "no_left_turn"}, {11, 14}),
        ({"restriction:motorcar": "no_left_turn"}, {11, 14}),
        ({"restriction:hgv": "no_left_turn"}, {11, 12, 14}),
        ({"restriction:conditional": "no_left_turn @ (07:00-09:00)"}, {11, 12, 14}),
        ({"restriction": "no_left_turn", "except": "bus;vehicle"}, {11, 12, 14}),
        ({"restriction": "no_left_turn", "except": "bicycle"}, {11, 14}),
        ({"restriction": "no_left_turn", "hour_on": "07:00", "hour_off": "18:00"}, {11, 12, 14}),
        ({"restriction": "no_left_turn", "time": "07:00-09:00"}, {11, 12, 14}),
        ({"restriction": "only_left_turn"}, {12}),
        ({"restriction": "no_left_turn_on_red"}, {11, 12, 14}),  # the turn itself is free
        ({"restriction": "no_straight_on"}, {11, 14}),  # the word is wrong, the members count
    ],
)
def test_what_holds_for_cars(tags, reached):
    assert _leaving_west(tags) == reached


def test_an_entry_forbidden_from_several_roads():
    members = [FROM_WEST, ("w", 14, "from"), VIA, ("w", 12, "to")]
    tags = {"type": "restriction", "restriction": "no_entry"}
    world = world_of(crossing(relations=[(1, members, tags)]))
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    into = {way_of[c.from_lane_id] for c in world.connections if way_of[c.to_lane_id] == 12}
    assert into == {11}


def test_two_ways_of_which_one_must_be_taken():
    assert _leaving_west({"restriction": "only_straight_on"}, ends=(11, 12)) == {11, 12}


def _only(relation: int, end: int) -> tuple[int, list[tuple[str, int, str]], dict[str, str]]:
    members = [FROM_WEST, VIA, ("w", end, "to")]
    return relation, members, {"type": "restriction", "restriction": "only_straight_on"}


def test_two_words_that_each_allow_one_way_alone_allow_both():
    world = world_of(crossing(relations=[_only(1, 11), _only(2, 12)]))
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    ends = {way_of[c.to_lane_id] for c in world.connections if way_of[c.from_lane_id] == 13}
    assert ends == {11, 12}


def test_who_may_go_nowhere_but_against_a_one_way_street_goes_as_without_the_word():
    street = {"highway": "residential", "name": "Lane", "oneway": "yes"}
    drawn = crossing(
        extra_nodes={20: (80.0, 80.0)}, extra_ways=[(20, [20, 0], street)], relations=[_only(7, 20)]
    )
    world = world_of(drawn)
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    ends = {way_of[c.to_lane_id] for c in world.connections if way_of[c.from_lane_id] == 13}
    assert ends == {11, 12, 14}
    assert [note for note in world.notes if note.startswith("relation 7: from way 13")]


def test_a_relation_without_an_end_forbids_nothing():
    assert _leaving_west({"restriction": "no_exit"}, ends=()) == {11, 12, 14}


def test_a_restriction_over_a_way_beyond_the_junction_is_named():
    members = [("w", 12, "from"), ("w", 13, "via"), ("w", 20, "to")]
    world = world_of(
        crossing(
            extra_nodes={20: (-100.0, 80.0)},
            extra_ways=[(20, [3, 20], {"highway": "residential", "name": "Lane"})],
            relations=[(7, members, {"type": "restriction", "restriction": "no_u_turn"})],
        )
    )
    assert [note for note in world.notes if note.startswith("relation 7:")]


def test_a_restriction_over_ways_within_a_junction_needs_no_note():
    maps = Path(__file__).parents[2] / "data" / "junctions"
    osm = read_map(maps / "32_restriction_via_way.osm")
    graph = build_road_graph(osm)
    (junction,) = find_intersections(osm, graph)
    assert len(read_turn_restrictions(osm, graph).over_ways) == 2
    assert not [n for n in build_world(osm, graph, junction).notes if n.startswith("relation")]


def _beside_an_island(forbidden: bool) -> set[int]:
    """Return where way 13 leads from the west: at node 0 it meets 12, which leads north, and an
    island's two sides, 21 and 23, behind which 31 and 32 leave."""
    nodes = {0: (0.0, 0.0), 2: (0.0, 100.0), 3: (-100.0, 0.0), 5: (14.0, -6.0), 6: (14.0, 6.0)}
    nodes |= {7: (110.0, -20.0), 8: (110.0, 20.0)}
    road = {"highway": "secondary"}
    ends = ([3, 0], [0, 2], [0, 5], [5, 6], [6, 0], [5, 7], [6, 8])
    ways = [(way, members, road) for way, members in zip(WAYS, ends, strict=True)]
    members = [FROM_WEST, VIA, ("w", 12, "to")]
    relations = [(1, members, {"type": "restriction", "restriction": "no_left_turn"})]
    world = world_of(drawn_map(nodes, ways, relations=relations if forbidden else ()))
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    return {way_of[c.to_lane_id] for c in world.connections if way_of[c.from_lane_id] == 13}


def test_a_forbidden_turn_is_not_made_by_a_tour_around_an_island():
    assert _beside_an_island(forbidden=False) == {12, 31, 32}
    assert _beside_an_island(forbidden=True) == {31, 32}
