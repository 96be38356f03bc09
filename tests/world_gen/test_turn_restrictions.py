"""Turn restrictions: which of a relation's words hold for cars, and where they lead."""

from __future__ import annotations

import pytest

from tests.world_gen.drawn_maps import crossing, world_of

FROM_WEST = ("w", 13, "from")
VIA = ("n", 0, "via")


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
        ({"restriction": "only_left_turn"}, {12}),
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


def test_a_relation_without_an_end_forbids_nothing():
    assert _leaving_west({"restriction": "no_exit"}, ends=()) == {11, 12, 14}
