"""A slight arrow beside a plain one of its side means the way that turns less."""

from __future__ import annotations

import math

import pytest

from foretwin.contracts.world import World
from tests.world_gen.drawn_maps import drawn_map, world_of

ONE_WAY = {"highway": "secondary", "oneway": "yes", "lanes": "2"}


def _world(arrows: str, *turns_deg: float) -> World:
    """Return a junction that way 1 enters eastward with these arrows; ways 2, 3, … leave it, each
    at an angle to the left of straight on."""
    nodes = {0: (0.0, 0.0), 1: (-120.0, 0.0)}
    lanes = str(arrows.count("|") + 1)
    ways = [(1, [1, 0], ONE_WAY | {"lanes": lanes, "turn:lanes": arrows})]
    for way, turn_deg in enumerate(turns_deg, start=2):
        a = math.radians(turn_deg)
        nodes[way] = (120.0 * math.cos(a), 120.0 * math.sin(a))
        ways.append((way, [0, way], ONE_WAY | {"name": f"To {way}"}))
    return world_of(drawn_map(nodes, ways))


def _from_lanes(world: World, way: int) -> set[int]:
    """Return which lanes of way 1 lead into a way, counted from the left."""
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    onto = [c for c in world.connections if way_of[c.to_lane_id] == way]
    return {int(c.from_lane_id[-1]) for c in onto if way_of[c.from_lane_id] == 1}


@pytest.mark.parametrize(
    ("arrows", "aside", "ahead", "first_turns"),
    [
        ("left;slight_left|slight_left", {0}, {0, 1}, ("left", "straight")),
        ("left|slight_left|slight_left", {0}, {1, 2}, ("left",)),
        ("sharp_left|slight_left", {0}, {1}, ("left",)),
    ],
)
def test_beside_the_only_turn_to_its_side_it_means_straight_on(
    arrows: str, aside: set[int], ahead: set[int], first_turns: tuple[str, ...]
):
    world = _world(arrows, 25.0, -3.0)
    assert [_from_lanes(world, way) for way in (2, 3)] == [aside, ahead]
    assert not [note for note in world.notes if "left out" in note]
    turns = [lane.turns for lane in world.lanes if lane.osm_way == 1]
    assert turns[:2] == [first_turns, ("straight",)]


def test_it_means_the_right_as_the_left():
    world = _world("slight_right|right;slight_right", 3.0, -25.0)
    assert [_from_lanes(world, way) for way in (2, 3)] == [{0, 1}, {1}]


@pytest.mark.parametrize("arrows", ["slight_left|left|through", "left|slight_left|"])
def test_where_other_lanes_lead_straight_on_it_turns_with_the_plain_one(arrows: str):
    world = _world(arrows, 25.0, -3.0)
    assert [_from_lanes(world, way) for way in (2, 3)] == [{0, 1}, {2}]


def test_alone_it_means_what_a_plain_one_does():
    assert _from_lanes(_world("slight_left|through", 60.0, 0.0), 2) == {0}


def test_of_several_turns_to_its_side_it_means_the_least():
    world = _world("left|slight_left|through", 100.0, 50.0, 0.0)
    assert [_from_lanes(world, way) for way in (2, 3, 4)] == [{0}, {1}, {2}]
    both = _world("left;slight_left|through", 100.0, 50.0, 0.0)
    assert [_from_lanes(both, way) for way in (2, 3, 4)] == [{0}, {0}, {1}]
