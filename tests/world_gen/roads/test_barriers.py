"""A bollard on a road closes it to cars, and nothing else of the street."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.barriers import STANDS_BACK_M, closes_to_cars
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, Tags, drawn_map, world_of

BOLLARD: Tags = {"barrier": "bollard", "bicycle": "yes"}
MIDDLE = 20
"""A node on Street, 60 m east of where it crosses Avenue."""


def street_with(tags: Tags) -> OsmMap:
    return drawn_map(
        CROSS | {MIDDLE: (60.0, 0.0)},
        [
            (11, [0, MIDDLE, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={MIDDLE: tags},
    )


@pytest.mark.parametrize(
    ("tags", "closed"),
    [
        ({"barrier": "bollard"}, True),
        ({"barrier": "bollard", "access": "private", "bus": "yes"}, True),
        ({"barrier": "bollard", "motor_vehicle": "no"}, True),
        ({"barrier": "block"}, True),
        ({"barrier": "cycle_barrier", "foot": "yes"}, True),
        ({"barrier": "gate", "access": "private"}, True),
        ({"barrier": "lift_gate", "vehicle": "no"}, True),
        ({"barrier": "bollard", "motor_vehicle": "yes"}, False),
        ({"barrier": "bollard", "access": "permissive"}, False),
        ({"barrier": "bollard", "access": "no", "motorcar": "destination"}, False),
        ({"barrier": "bollard", "bollard": "rising"}, False),
        ({"barrier": "bollard", "bollard": "rising", "access": "private"}, True),
        ({"barrier": "gate"}, False),
        ({"barrier": "gate", "bicycle": "no", "foot": "no"}, False),
        ({"barrier": "border_control", "motorcar": "yes"}, False),
        ({"barrier": "kerb"}, False),
        ({"highway": "crossing", "access": "no"}, False),
    ],
)
def test_what_closes_a_road(tags: Tags, closed: bool) -> None:
    assert closes_to_cars(tags) is closed


def test_a_road_ends_on_both_sides_of_a_bollard() -> None:
    graph = build_road_graph(street_with(BOLLARD))
    near, far = (edge for edge in graph.edges if edge.way_id == 11)
    assert graph.closed_nodes == {MIDDLE}
    assert (near.start_node, near.end_node) == (0, MIDDLE)
    assert (far.start_node, far.end_node) == (-MIDDLE, 1)
    np.testing.assert_allclose(near.xy_m[-1] - near.xy_m[0], [60.0 - STANDS_BACK_M, 0.0], atol=0.01)
    assert near.length_m == pytest.approx(60.0 - STANDS_BACK_M, abs=0.01)
    assert far.length_m == pytest.approx(40.0 - STANDS_BACK_M, abs=0.01)
    for edge in (near, far):
        assert len(edge.node_ids) == len(edge.xy_m)
        assert edge.forward
        assert edge.backward
    assert [item.edge.index for item in graph.at_node(MIDDLE)] == [near.index]
    assert [item.edge.index for item in graph.at_node(-MIDDLE)] == [far.index]
    assert graph.node_xy_m[-MIDDLE] == tuple(far.xy_m[0].tolist())


def test_an_open_gate_changes_nothing() -> None:
    graph = build_road_graph(street_with({"barrier": "gate"}))
    assert [edge.node_ids for edge in graph.edges if edge.way_id == 11] == [(0, MIDDLE, 1)]
    assert graph.closed_nodes == frozenset()


def test_a_world_has_the_bollard_and_no_lane_past_it() -> None:
    world = world_of(street_with(BOLLARD))
    assert [one.id for one in world.obstacles] == [f"n{MIDDLE}"]
    ends = [lane.centerline[:, 0] for lane in world.lanes if lane.id.startswith("w11.")]
    assert len(ends) == 4  # two directions on either side
    assert all(x.max() < 59.01 or x.min() > 60.99 for x in ends)
    past = {lane.id for lane in world.lanes if lane.centerline[:, 0].min() > 60.0}
    assert not [c for c in world.connections if {c.from_lane_id, c.to_lane_id} & past]
    assert f"node {MIDDLE}: barrier=bollard closes the road to cars; lanes end before it" in (
        world.notes
    )


def test_the_street_up_to_the_bollard_is_an_arm_of_its_junction() -> None:
    osm = street_with(BOLLARD)
    (junction,) = find_intersections(osm, build_road_graph(osm))
    assert junction.summary.arms == 4


def test_blocks_behind_each_other_leave_a_piece_between() -> None:
    nodes = {1: (0.0, 0.0), 2: (40.0, 0.0), 3: (42.0, 0.0), 4: (80.0, 0.0)}
    block = {"barrier": "block"}
    osm = drawn_map(nodes, [(5, (1, 2, 3, 4), STREET)], node_tags={2: block, 3: block})
    found = build_road_graph(osm).edges
    assert [(edge.start_node, edge.end_node) for edge in found] == [(1, 2), (-2, 3), (-3, 4)]
    assert [edge.length_m for edge in found] == pytest.approx([39.0, 1.0, 37.0], abs=0.01)


def test_a_bollard_at_the_end_of_a_road_stands_behind_it() -> None:
    nodes = {1: (0.0, 0.0), 2: (40.0, 0.0), 3: (80.0, 0.0)}
    ways = [(5, (1, 2), STREET), (6, (2, 3), {"highway": "cycleway"})]
    (edge,) = build_road_graph(drawn_map(nodes, ways, node_tags={2: BOLLARD})).edges
    assert edge.end_node == 2
    assert edge.length_m == pytest.approx(39.0, abs=0.01)


@pytest.mark.parametrize(
    "further", [STREET, {"highway": "service"}, {"highway": "residential", "vehicle": "no"}]
)
def test_where_more_roads_meet_a_bollard_closes_none(further: Tags) -> None:
    nodes = {1: (0.0, 0.0), 2: (40.0, 0.0), 3: (80.0, 0.0), 4: (40.0, 40.0)}
    ways = [(5, (1, 2, 3), STREET), (6, (2, 4), further)]
    graph = build_road_graph(drawn_map(nodes, ways, node_tags={2: BOLLARD}))
    assert len(graph.at_node(2)) == 3
    assert graph.closed_nodes == frozenset()


def test_a_street_that_goes_on_closed_to_cars_still_meets_it() -> None:
    """A car may have to drive in all the same, as one of those who live there."""
    nodes = {1: (0.0, 0.0), 2: (40.0, 0.0), 3: (80.0, 0.0)}
    ways = [(5, (1, 2), STREET), (6, (2, 3), {**STREET, "vehicle": "no"})]
    graph = build_road_graph(drawn_map(nodes, ways, node_tags={2: BOLLARD}))
    assert len(graph.at_node(2)) == 2
