"""Whatever roads meet: turns leave and reach their lanes smoothly, and no lane overlaps another."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString

from foretwin.contracts.world import Connection, World
from foretwin.world_gen.roads.headings import heading_out
from foretwin.world_gen.roads.road_graph import DirectedEdge
from tests.world_gen.drawn_stars import stars, world_of_star
from tests.world_gen.path_shape import end_bends_rad, tightest_radius_m
from tests.world_gen.road_edges import road as straight_road

COVERS = (
    "foretwin.world_gen.lanes.legs",
    "foretwin.world_gen.lanes.trims",
    "foretwin.world_gen.roads.headings",
)

LEAST_RADIUS_M = 4.0


@settings(max_examples=30, deadline=None)
@given(arms=stars(), left_hand=st.booleans())
def test_turns_begin_and_end_on_their_lanes_and_can_be_driven(arms, left_hand):
    world = world_of_star(arms, left_hand=left_hand)
    lanes = {lane.id: lane for lane in world.lanes}
    for c in world.connections:
        start, end = lanes[c.from_lane_id].centerline, lanes[c.to_lane_id].centerline
        np.testing.assert_array_equal(c.centerline[0], start[-1])
        np.testing.assert_array_equal(c.centerline[-1], end[0])
        assert max(end_bends_rad(start, c.centerline, end)) < math.radians(1.0)
        named = any(_names(note, world, c) for note in world.notes)
        assert named or tightest_radius_m(c.centerline) >= 0.93 * LEAST_RADIUS_M


def _names(note: str, world: World, connection: Connection) -> bool:
    lanes = {lane.id: lane for lane in world.lanes}
    start, end = lanes[connection.from_lane_id], lanes[connection.to_lane_id]
    return f"way {start.osm_way}:" in note and "radius" in note and f"way {end.osm_way} " in note


@settings(max_examples=20, deadline=None)
@given(arms=stars(), left_hand=st.booleans())
def test_lanes_of_one_arm_never_overlap(arms, left_hand):
    world = world_of_star(arms, left_hand=left_hand)
    lanes = {lane.id: lane for lane in world.lanes}
    for road in world.roads:
        strips = [
            LineString(lanes[i].centerline).buffer(
                lanes[i].width_m.value / 2 - 0.02, cap_style="flat"
            )
            for i in road.lane_ids
        ]
        for i, strip in enumerate(strips):
            for other in strips[i + 1 :]:
                assert strip.intersection(other).area < 0.01


@settings(max_examples=20, deadline=None)
@given(arms=stars(), left_hand=st.booleans())
def test_lanes_lie_beside_their_roads_reference_line(arms, left_hand):
    world = world_of_star(arms, left_hand=left_hand)
    lanes = {lane.id: lane for lane in world.lanes}
    for road in world.roads:
        line = LineString(road.reference_line)
        for lane in (lanes[i] for i in road.lane_ids):
            beside = line.offset_curve(lane.left_of_reference_m, join_style="mitre")
            assert LineString(lane.centerline).hausdorff_distance(beside) < 0.01


@settings(max_examples=20, deadline=None)
@given(arms=stars(), left_hand=st.booleans())
def test_a_mirrored_map_gives_a_mirrored_world(arms, left_hand):
    world = world_of_star(arms, left_hand=left_hand)
    mirror = world_of_star(arms, left_hand=not left_hand, mirror=True)
    twin_of = {}
    for mine, its in ((world.lanes, mirror.lanes), (world.connections, mirror.connections)):
        assert len(mine) == len(its)
        for item in mine:
            (twin,) = (other for other in its if _mirrored(item.centerline, other.centerline))
            twin_of[item.id] = twin.id
            assert twin.width_m == item.width_m
    turns = {c.id: c.turn for c in mirror.connections}
    swapped = {"left": "right", "right": "left"}
    for c in world.connections:
        assert turns[twin_of[c.id]] == swapped.get(c.turn, c.turn)
    pairs = {frozenset((c.first_id, c.second_id)) for c in mirror.conflicts}
    assert {
        frozenset((twin_of[c.first_id], twin_of[c.second_id])) for c in world.conflicts
    } == pairs


def _mirrored(mine: np.ndarray, its: np.ndarray) -> bool:
    if len(mine) != len(its):
        return False
    return bool(np.abs(mine * [-1.0, 1.0] - its).max() < 0.003)


def test_a_leg_heads_where_it_leads_over_its_first_metres():
    line = np.array([[100.0, 50.0], [103.0, 54.0], [107.0, 57.0]])
    bent = msgspec.structs.replace(straight_road(), xy_m=line)
    assert heading_out(DirectedEdge(bent, reverse=False), 2.0) == pytest.approx((0.6, 0.8))
    assert heading_out(DirectedEdge(bent, reverse=False), 5.0) == pytest.approx((0.6, 0.8))
    assert heading_out(DirectedEdge(bent, reverse=False), 10.0) == pytest.approx(
        np.array([7.0, 7.0]) / math.hypot(7.0, 7.0)
    )
