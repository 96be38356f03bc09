"""Paths go on with the bends of the lanes that they join, and turn back where there is room."""

from __future__ import annotations

import numpy as np

from tests.world_gen.drawn_maps import roundabout, world_of


def test_cars_go_round_a_ring_without_straightening_at_its_nodes():
    world = world_of(roundabout())
    ring = {lane.id for lane in world.lanes if lane.role == "ring"}
    round_it = [c for c in world.connections if {c.from_lane_id, c.to_lane_id} <= ring]
    assert len(round_it) == 3
    for c in round_it:
        from_centre_m = np.hypot(*c.centerline.T)
        assert np.ptp(from_centre_m) < 0.1
