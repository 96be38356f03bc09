"""Roads that part and merge: lanes paired by where they lie, and no turn back around a nose."""

from __future__ import annotations

import msgspec
import pytest

from foretwin.contracts.world import World
from foretwin.world_gen.extent import Disc
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.lanes.clusters import Surroundings, surroundings, world_frame
from foretwin.world_gen.lanes.lane_curves import LaneKey, build_lanes, join_straight_on
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import drawn_map, world_of

ONE_WAY = {"highway": "motorway", "oneway": "yes"}


def _pairs(world: World, first: int, second: int) -> set[tuple[int, int]]:
    """Return which lane of one way leads to which lane of another, counted from the left."""
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    return {
        (int(c.from_lane_id[-1]), int(c.to_lane_id[-1]))
        for c in world.connections
        if (way_of[c.from_lane_id], way_of[c.to_lane_id]) == (first, second)
    }


def _motorway(fork: bool, lanes: tuple[int, int, int], **tags: str) -> World:
    """Return a motorway (way 1) that forks into ways 2 and 3, or into which these merge."""
    nodes = {0: (0.0, 0.0), 1: (-140.0, 0.0), 2: (140.0, 5.0), 3: (140.0, -35.0)}
    if not fork:
        nodes = {node: (-x, y) for node, (x, y) in nodes.items()}
    ways = [
        (i, nds if fork else nds[::-1], ONE_WAY | {"lanes": str(count), "name": f"Road {i}"})
        for i, nds, count in zip((1, 2, 3), ([1, 0], [0, 2], [0, 3]), lanes, strict=True)
    ]
    ways[0] = (1, ways[0][1], ways[0][2] | tags)
    return world_of(drawn_map(nodes, ways))


def test_a_fork_shares_the_lanes_of_a_motorway():
    world = _motorway(True, (4, 3, 2), **{"turn:lanes": "|||right"})
    assert _pairs(world, 1, 2) == {(0, 0), (1, 1), (2, 2)}
    assert _pairs(world, 1, 3) == {(2, 0), (3, 1)}


def test_at_most_one_lane_of_a_motorway_leads_into_both_branches():
    world = _motorway(True, (3, 2, 2))
    assert _pairs(world, 1, 2) == {(0, 0), (1, 1)}
    assert _pairs(world, 1, 3) == {(1, 0), (2, 1)}


def test_arrows_straight_on_mean_every_branch_that_no_arrow_names():
    world = _motorway(True, (3, 2, 1), **{"turn:lanes": "through|through|through"})
    assert _pairs(world, 1, 2) == {(0, 0), (1, 1)}
    assert _pairs(world, 1, 3) == {(2, 0)}
    assert not [note for note in world.notes if "left out" in note]
    named = _motorway(True, (3, 2, 1), **{"turn:lanes": "through|through;right|right"})
    assert _pairs(named, 1, 3) == {(1, 0), (2, 0)}


def test_three_branches_share_lanes_whose_arrows_all_point_straight_on():
    nodes = {0: (0.0, 0.0), 1: (-120.0, 0.0), 2: (110.0, 60.0), 3: (120.0, 4.0), 4: (115.0, -45.0)}
    arrows = {"lanes": "3", "turn:lanes": "through|through|through"}
    ways = [(1, [1, 0], arrows), (2, [0, 2], {}), (3, [0, 3], {}), (4, [0, 4], {})]
    osm = drawn_map(
        nodes, [(i, nds, ONE_WAY | {"lanes": "1", "name": f"To {i}"} | t) for i, nds, t in ways]
    )
    world = world_of(osm)
    assert [_pairs(world, 1, i) for i in (2, 3, 4)] == [{(0, 0)}, {(1, 0)}, {(2, 0)}]


def test_arrows_straight_on_mean_no_way_that_turns_off_and_back():
    """A ramp of the same heading begins across the other carriageway: that is a turn."""
    nodes = {0: (0.0, 0.0), 1: (-120.0, 0.0), 2: (120.0, 0.0), 3: (120.0, 14.0)}
    nodes |= {4: (0.0, 14.0), 5: (-120.0, 14.0), 6: (120.0, 40.0)}
    street = {"highway": "primary", "name": "Street", "oneway": "yes", "lanes": "2"}
    ways = [
        (1, [1, 0], street | {"turn:lanes": "through|through"}),
        (2, [0, 2], street),
        (3, [3, 4, 5], street),
        (4, [0, 4], {"highway": "primary"}),
        (5, [4, 6], {"highway": "primary_link", "name": "Ramp", "oneway": "yes"}),
    ]
    world = world_of(drawn_map(nodes, ways))
    assert _pairs(world, 1, 2) == {(0, 0), (1, 1)}
    assert not _pairs(world, 1, 5)


@pytest.mark.parametrize(
    ("lanes", "main", "ramp"),
    [
        ((4, 3, 1), {(0, 0), (1, 1), (2, 2)}, {(0, 3)}),
        ((3, 3, 1), {(0, 0), (1, 1), (2, 2)}, {(0, 2)}),
        ((4, 2, 1), {(0, 0), (0, 1), (1, 2)}, {(0, 3)}),
    ],
)
def test_a_ramp_merges_into_the_lanes_on_its_side(lanes, main, ramp):
    world = _motorway(False, lanes)
    assert _pairs(world, 2, 1) == main
    assert _pairs(world, 3, 1) == ramp


def _parting(name: str) -> World:
    """Return a crossing in whose middle a street parts into two carriageways to the east."""
    street = {"highway": "secondary", "name": "Street"}
    nodes = {
        0: (0.0, 0.0),
        1: (-90.0, 0.0),
        2: (0.0, 90.0),
        3: (0.0, -90.0),
        4: (20.0, 5.0),
        5: (120.0, 5.0),
        6: (20.0, -5.0),
        7: (120.0, -5.0),
    }
    return world_of(
        drawn_map(
            nodes,
            [
                (10, [1, 0], street),
                (11, [2, 0, 3], {"highway": "residential", "name": "Avenue"}),
                (20, [5, 4, 0], street | {"oneway": "yes"}),
                (21, [0, 6, 7], street | {"oneway": "yes", "name": name}),
            ],
        )
    )


def test_nobody_turns_back_into_the_other_carriageway():
    assert not _pairs(_parting("Street"), 20, 21)


def test_back_along_a_parting_carriageway_is_a_u_turn():
    world = _parting("Ramp")
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    back = {
        c.turn
        for c in world.connections
        if (way_of[c.from_lane_id], way_of[c.to_lane_id]) == (20, 21)
    }
    assert back == {"u_turn"}


def _street() -> Surroundings:
    """Return a one-way street of three lanes that goes on in a second way, behind a crossing."""
    tags = {"highway": "secondary", "name": "Street", "oneway": "yes", "lanes": "3"}
    nodes = {0: (0.0, 0.0), 1: (-90.0, 0.0), 2: (60.0, 0.0), 3: (120.0, 0.0), 4: (0.0, 90.0)}
    osm = drawn_map(
        nodes,
        [
            (1, [1, 0, 2], tags),
            (2, [2, 3], tags),
            (3, [0, 4], {"highway": "residential", "name": "Avenue"}),
        ],
    )
    graph = build_road_graph(osm)
    (junction,) = find_intersections(osm, graph)
    index = index_map(osm, graph, (junction,))
    return surroundings(index, world_frame(junction), Disc(150.0), (junction,))


def test_a_lane_too_short_to_be_drawn_does_not_shift_its_neighbours():
    around = _street()
    lanes = build_lanes(around)
    (plain,) = (c for c in around.clusters if c.plain)
    (second,) = {lane.key.edge for lane in lanes.begins.values() if lane.id.startswith("w2.")}
    begins = {key: lane for key, lane in lanes.begins.items() if key != LaneKey(second, False, 0)}
    assert join_straight_on(plain, around, msgspec.structs.replace(lanes, begins=begins))
    (first,) = {
        lane.key.edge
        for lane in lanes.lanes.values()
        if lane.id.startswith("w1.")
        and LaneKey(lane.key.edge, False, 0) in lanes.ends
        and any(leg.edge.index == lane.key.edge for leg in plain.legs)
    }
    onto = [lanes.ends[LaneKey(first, False, n)].successors for n in range(3)]
    assert onto == [[], *([lanes.begins[LaneKey(second, False, n)].id] for n in (1, 2))]


def test_a_place_beyond_the_worlds_edge_is_none():
    one_way = {"highway": "secondary", "name": "Street", "oneway": "yes"}
    nodes = {
        0: (0.0, 0.0),
        1: (-90.0, 0.0),
        2: (0.0, 90.0),
        3: (146.0, 0.0),
        4: (300.0, 8.0),
        5: (300.0, -8.0),
        6: (30.0, 0.0),
    }
    world = world_of(
        drawn_map(
            nodes,
            [
                (1, [1, 0], {"highway": "secondary", "name": "Street"}),
                (2, [0, 2], {"highway": "residential", "name": "Avenue"}),
                (3, [0, 6, 3], {"highway": "secondary", "name": "Street"}),
                (4, [3, 5], one_way),
                (5, [4, 3], one_way),
            ],
        )
    )
    led = {c.place_id for c in world.connections}
    (east,) = (road for road in world.roads if road.osm_way == 3)
    assert east.from_place in led
    assert east.to_place is None
