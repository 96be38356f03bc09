"""A way is led on lane by lane; where somebody is on it does not move by that."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.road_users.right_of_way import JunctionRules
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.seen import LaneSearch
from foretwin.sim_worker.virtual_traffic.rider import Rider, RoadsInForce
from tests.sim_worker.places import crossroads

WORLD = crossroads()
NETWORK = RoadNetwork(WORLD)
ROADS = RoadsInForce(NETWORK, LaneSearch(WORLD.lanes), JunctionRules(WORLD))


def rider(arc_m: float, *, lane: str = "from_east") -> Rider:
    line = NETWORK.lanes[lane].centerline
    path = FrenetPath(line)
    return Rider(
        "r", "car", (4.5, 1.8), 1.0, line, np.full(len(line), 13.9), lane, arc_m, 8.0, path, ()
    )


@pytest.mark.parametrize("arc_m", [0.0, 31.4, 100.7, 131.9])
def test_it_is_led_on_from_where_it_is(arc_m: float) -> None:
    one = rider(arc_m)
    before = one.path.point_at(np.array([one.arc_m]))
    assert one.lead_on(ROADS, 150.0, np.random.default_rng(0))
    assert one.path.point_at(np.array([one.arc_m])) == pytest.approx(before, abs=1e-6)
    assert one.left_m == pytest.approx(280.0 - arc_m, abs=0.1)
    assert one.arc_m <= 31.0
    assert one.shifted_m == pytest.approx(one.arc_m - arc_m)
    assert [taken.connection.id for taken in one.taken] == ["east"]


def test_where_lanes_end_it_is_known_and_asked_once() -> None:
    one = rider(10.0, lane="to_east")
    assert one.lead_on(ROADS, 300.0, np.random.default_rng(0))
    assert one.ended
    assert not one.lead_on(ROADS, 300.0, np.random.default_rng(0))


def test_who_has_left_its_way_goes_on_straight() -> None:
    one = rider(10.0, lane="to_east")
    one.arc_m = 200.0
    assert one.lead_on(ROADS, 300.0, np.random.default_rng(0))
    place = one.path.point_at(np.array([one.arc_m]))[0]
    assert place == pytest.approx([208.0, -1.5], abs=1e-6)


@pytest.mark.parametrize("points", [20, 34])
def test_in_another_world_the_lane_under_its_end_leads_on(points: int) -> None:
    """Also where the way ends with that lane."""
    one = rider(10.0)
    one.xy_m, one.limit_mps, one.last_id = one.xy_m[:points], one.limit_mps[:points], None
    one.path = FrenetPath(one.xy_m)
    assert one.lead_on(ROADS, 200.0, np.random.default_rng(0))
    assert one.last_id == "to_east"
    assert one.left_m == pytest.approx(270.0, abs=0.1)
