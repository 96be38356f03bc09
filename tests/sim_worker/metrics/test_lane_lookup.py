"""Points on lanes: which one, of several that cross or lie on one another."""

from __future__ import annotations

import math

import numpy as np

from foretwin.sim_worker.metrics.lane_areas import LaneAreas
from tests.sim_worker.places import crossroads


def test_a_point_is_on_the_lane_that_is_driven_as_it_is_headed() -> None:
    lookup = LaneAreas(crossroads()).lookup
    xy = np.array([[-50.0, -1.5], [-50.0, 1.5], [0.5, -1.2], [0.5, -1.2], [-50.0, 20.0]])
    yaw = np.array([0.1, math.pi, 0.0, math.pi / 2, 0.0])
    assert lookup.at(xy, yaw) == ("from_east", "to_west", "east", "north", "")


def test_what_is_no_place_is_on_none() -> None:
    lookup = LaneAreas(crossroads()).lookup
    assert lookup.at(np.array([[np.nan, 0.0], [-50.0, -1.5]]), np.array([0.0, np.nan])) == ("", "")
    assert lookup.at(np.zeros((0, 2)), np.zeros(0)) == ()
