"""Paths go on with the bends of the lanes that they join, and turn back where there is room."""

from __future__ import annotations

import math

import numpy as np

from tests.world_gen.drawn_maps import AVENUE, STREET, drawn_map, roundabout, world_of
from tests.world_gen.path_shape import end_bends_rad, tightest_radius_m


def test_cars_go_round_a_ring_without_straightening_at_its_nodes():
    world = world_of(roundabout())
    ring = {lane.id for lane in world.lanes if lane.role == "ring"}
    round_it = [c for c in world.connections if {c.from_lane_id, c.to_lane_id} <= ring]
    assert len(round_it) == 3
    for c in round_it:
        from_centre_m = np.hypot(*c.centerline.T)
        assert np.ptp(from_centre_m) < 0.1


def test_who_turns_sharply_into_a_road_beside_swings_out_instead_of_turning_on_the_spot():
    nodes = {0: (0.0, 0.0), 1: (100.0, 0.0), 2: (99.0, 14.0), 3: (-100.0, 0.0)}
    ways = [(11, [0, 1], STREET), (12, [0, 2], AVENUE), (13, [0, 3], STREET)]
    world = world_of(drawn_map(nodes, ways))
    lanes = {lane.id: lane for lane in world.lanes}
    sharp = [
        c
        for c in world.connections
        if {lanes[c.from_lane_id].osm_way, lanes[c.to_lane_id].osm_way} == {11, 12}
    ]
    assert {c.turn for c in sharp} == {"left", "right"}
    for c in sharp:
        start, end = lanes[c.from_lane_id].centerline, lanes[c.to_lane_id].centerline
        assert max(end_bends_rad(start, c.centerline, end)) < math.radians(1.0)
        assert tightest_radius_m(c.centerline) > 2.5


def test_who_turns_back_where_two_dual_carriageways_cross_on_the_skew_stays_between_them():
    """East and west 8 m from the middle, north and south 6 m, leaning by 17°."""
    corners = {1: (6.0, -8.0), 2: (6.0, 8.0), 3: (-6.0, 8.0), 4: (-6.0, -8.0)}
    far = {11: (-120.0, -8.0), 12: (120.0, -8.0), 13: (120.0, 8.0), 14: (-120.0, 8.0)}
    far |= {15: (6.0, -120.0), 16: (6.0, 120.0), 17: (-6.0, 120.0), 18: (-6.0, -120.0)}
    nodes = {node: (x - 0.3 * y, y) for node, (x, y) in (corners | far).items()}
    across, along = ({**road, "oneway": "yes", "lanes": "2"} for road in (AVENUE, STREET))
    ways = [(21, [11, 4, 1, 12], across), (22, [13, 2, 3, 14], across)]
    ways += [(23, [15, 1, 2, 16], along), (24, [17, 3, 4, 18], along)]
    back = [c for c in world_of(drawn_map(nodes, ways)).connections if c.turn == "u_turn"]
    assert len(back) == 4
    for c in back:
        upright = c.centerline + np.outer(c.centerline[:, 1], (0.3, 0.0))
        axis = int(np.argmax(abs(upright[0])))
        beyond_m = -(np.sign(upright[0, axis]) * upright[:, axis]).min()
        # Lanes of the farther carriageway reach 3.25 m beyond its middle.
        assert beyond_m < (6.0, 8.0)[axis] + 3.25
