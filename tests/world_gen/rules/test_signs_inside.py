"""Signs inside junctions have a line where they stand, and who passes them waits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.provenance import Choice
from foretwin.world_gen.osm.osm_map import OsmMap
from tests.world_gen.drawn_maps import crossing, drawn_map, roundabout, world_of
from tests.world_gen.slip_roads import (
    SIGN,
    check_lines,
    lines_inside,
    node_at,
    slip_map,
    slip_world,
)

COVERS = ("foretwin.world_gen.rules.junction_rules",)

GIVE_WAY = {"highway": "give_way"}


@settings(max_examples=8, deadline=None)
@given(share=st.floats(0.3, 0.85))
def test_the_line_of_a_slip_road_lies_at_its_sign(share):
    osm = slip_map(share)
    world = world_of(osm)
    assert check_lines(world) == 1
    ((line, _),) = lines_inside(world)
    assert np.hypot(*(line.ends.mean(axis=0) - node_at(osm, world, SIGN))) < 2.0
    mirrored = slip_world(share, left_hand=True)
    assert check_lines(mirrored) == 1
    ((other, _),) = lines_inside(mirrored)
    # Their frames are not the same: of both places the earth is not equally round.
    assert other.ends[::-1] * [-1.0, 1.0] == pytest.approx(line.ends, abs=0.02)


@pytest.mark.parametrize("word", ["stop", "give_way"])
def test_who_comes_past_the_sign_of_a_slip_road_waits_for_everyone(word):
    world = slip_world(sign={"highway": word})
    ((line, slip),) = lines_inside(world)
    assert line.control == Choice(word, "tagged")
    assert (slip.turn, slip.control, slip.signal_group_id) == ("right", word, None)
    name = {lane.id: lane.name for lane in world.lanes}
    by_id = {c.id: c for c in world.connections}
    mine = [c for c in world.conflicts if slip.id in (c.first_id, c.second_id)]
    assert {(c.yields_id, c.rule, c.source) for c in mine} == {(slip.id, word, "tagged")}
    # Those straight on from the west, and those who come from the east and turn back or left.
    assert "straight" in {by_id[c.goes_id].turn for c in mine}
    assert {name[by_id[c.goes_id].from_lane_id] for c in mine} == {"Main Street"}
    # The lights' own lines stay what they were.
    lanes = {ln.control.value for ln in world.stop_lines if ln.connection_id is None}
    assert lanes == {"signal"}


def test_a_slip_road_waits_for_those_who_turn_into_its_road_across_oncoming_traffic():
    """Also if these come from a lesser road, for which the lights say when to go."""
    osm = slip_map()
    north = {5: (0.0, 120.0)}
    place = {node: node_at_origin(osm, node) for node in osm.locations}
    world = world_of(
        drawn_map(
            {**place, **north},
            [
                *((w.id, w.nodes, w.tags) for w in osm.ways.values()),
                (16, [5, 0], {"highway": "tertiary", "name": "Lane"}),
            ],
            node_tags=osm.node_tags,
        )
    )
    ((_, slip),) = lines_inside(world)
    by_id = {c.id: c for c in world.connections}
    left = [
        c
        for c in world.conflicts
        if slip.id in (c.first_id, c.second_id)
        and "left" in (by_id[c.first_id].turn, by_id[c.second_id].turn)
    ]
    assert [(c.yields_id, c.rule, c.kind) for c in left] == [(slip.id, "give_way", "merging")]


def node_at_origin(osm: OsmMap, node: int) -> tuple[float, float]:
    """Return a node's place in the map's own frame."""
    x, y = local_from_geo(osm.frame, *osm.locations[node]).reshape(2).tolist()
    return x, y


MOUTH = {
    0: (0.0, 0.0),
    1: (120.0, 0.0),
    3: (-120.0, 0.0),
    4: (0.0, -120.0),
    6: (0.0, -24.0),
    7: (-10.0, 0.0),
    8: (10.0, 0.0),
    9: (-9.0, -8.0),
    10: (9.0, -8.0),
}


def split_mouth(**sign: str) -> OsmMap:
    """A stem that parts into entry and exit; node 10 is 8 m before the end of the entry."""
    main = {"highway": "tertiary", "name": "Main Street"}
    stem = {"highway": "tertiary", "name": "Stem"}
    return drawn_map(
        MOUTH,
        [
            (11, [3, 7, 0, 8, 1], main),
            (14, [4, 6], stem),
            (15, [6, 10, 8], {**stem, "oneway": "yes"}),
            (16, [7, 9, 6], {**stem, "oneway": "yes"}),
        ],
        node_tags={10: sign} if sign else {},
    )


def test_a_sign_in_a_split_mouth_is_the_road_s_own():
    osm = split_mouth(highway="stop")
    world = world_of(osm)
    name = {lane.id: lane.name for lane in world.lanes}
    turns = {connection.turn for _, connection in lines_inside(world)}
    assert check_lines(world) == len(lines_inside(world))
    assert {"left", "right"} <= turns
    # Nobody waits where the mouth parts.
    (line,) = [s for s in world.stop_lines if s.connection_id is None and name[s.lane_id] == "Stem"]
    assert line.control == Choice("none", "inferred")
    by_id = {c.id: c for c in world.connections}
    main = [
        c
        for c in world.conflicts
        if {name[by_id[i].from_lane_id] for i in (c.first_id, c.second_id)}
        == {"Main Street", "Stem"}
    ]
    assert main
    assert {(name[by_id[c.yields_id].from_lane_id], c.rule) for c in main} == {("Stem", "stop")}


def test_on_a_road_of_both_ways_a_sign_is_for_those_who_come_to_the_nearer_end():
    """Inside a staggered junction: the sign stands nearer to the western of its two mouths."""
    nodes = {
        0: (-12.0, 0.0),
        1: (12.0, 0.0),
        2: (-6.0, 0.0),
        3: (-120.0, 0.0),
        4: (120.0, 0.0),
        5: (-12.0, -120.0),
        6: (12.0, 120.0),
    }
    main = {"highway": "tertiary", "name": "Main Street"}
    osm = drawn_map(
        nodes,
        [
            (11, [3, 0], main),
            (12, [0, 2, 1], main),
            (13, [1, 4], main),
            (14, [5, 0], {"highway": "tertiary", "name": "South"}),
            (15, [6, 1], {"highway": "tertiary", "name": "North"}),
        ],
        node_tags={2: GIVE_WAY},
    )
    world = world_of(osm)
    found = lines_inside(world)
    assert check_lines(world) > 0
    assert {np.sign((c.centerline[-1] - c.centerline[0])[0]) for _, c in found} == {-1.0}


def test_a_sign_on_a_node_to_which_one_road_alone_leads_is_tagged_for_it():
    osm = split_mouth()
    lone = drawn_map(
        MOUTH | {5: (0.0, -60.0)},
        [
            (11, [3, 7, 0, 8, 1], {"highway": "tertiary", "name": "Main Street"}),
            (14, [4, 6], {"highway": "tertiary", "name": "Stem", "oneway": "yes"}),
            (15, [6, 10, 8], {"highway": "tertiary", "oneway": "yes"}),
            (16, [6, 9, 7], {"highway": "tertiary", "oneway": "yes"}),
        ],
        node_tags={6: {"highway": "stop"}},
    )
    assert osm.locations[6] == lone.locations[6]
    world = world_of(lone)
    name = {lane.id: lane.name for lane in world.lanes}
    (line,) = [s for s in world.stop_lines if name[s.lane_id] == "Stem"]
    assert line.control == Choice("stop", "tagged")


def test_a_way_past_a_roundabout_has_the_line_of_its_sign():
    ring = roundabout()
    place = {node: node_at_origin(ring, node) for node in ring.locations}
    # From the eastern arm around the ring's north-east into the northern one.
    past = {51: (45.0, 0.0), 52: (30.0, 25.0), 53: (6.0, 38.0), 54: (0.0, 45.0)}
    ways = {way.id: (way.id, way.nodes, way.tags) for way in ring.ways.values()}
    ways[11] = (11, (100, 51, 1), ways[11][2])
    ways[12] = (12, (106, 54, 2), ways[12][2])
    link = {"highway": "tertiary_link", "oneway": "yes"}
    osm = drawn_map(
        place | past,
        [*ways.values(), (14, [51, 52, 53, 54], link)],
        node_tags={53: GIVE_WAY},
    )
    world = world_of(osm)
    way_of = {lane.id: lane.osm_way for lane in world.lanes}
    lines = [s for s in world.stop_lines if way_of[s.lane_id] == 14]
    assert [line.control for line in lines] == [Choice("give_way", "tagged")]
    assert np.hypot(*(lines[0].ends.mean(axis=0) - node_at(osm, world, 53))) < 6.0
    by_id = {c.id: c for c in world.connections}
    met = [
        c
        for c in world.conflicts
        if 14 in {way_of[by_id[i].from_lane_id] for i in (c.first_id, c.second_id)}
    ]
    assert met
    assert {(way_of[by_id[c.yields_id].from_lane_id], c.rule) for c in met} == {(14, "give_way")}


def test_a_junction_without_inner_roads_has_no_such_line():
    assert not lines_inside(world_of(crossing(node_tags={0: GIVE_WAY})))
