"""Ways through junctions: turns named by the traffic, rings passed on, and paths long enough."""

from __future__ import annotations

import collections
import math

import numpy as np
import pytest

from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.world import World
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.ways import APPROACH_M, DEPARTURE_M, traffic_turn
from tests.sim_worker.scenarios.worlds import cross, motorway, ring, tee
from tests.world_gen.drawn_maps import AVENUE, STREET, crossing, world_of

COVERS = ("foretwin.sim_worker.scenarios.ways",)


def network(world: World) -> tuple[RoadNetwork, str]:
    return RoadNetwork(world), world.intersection.id


@pytest.mark.parametrize("left_hand", [False, True])
def test_a_crossing_has_every_turn_from_every_arm(left_hand: bool) -> None:
    roads, junction = network(cross(left_hand=left_hand))
    turns = collections.Counter(passage.turn for passage in roads.passages(junction))
    assert turns == {"straight": 4, "across": 4, "near": 4}
    for passage in roads.passages(junction):
        turned = float(wrap_angle(passage.exit_heading_rad - passage.entry_heading_rad))
        # Where traffic keeps right, one turns left across it.
        side = {"straight": 0.0, "across": math.pi / 2, "near": -math.pi / 2}
        expected = side[passage.turn or "straight"] * roads.near_sign
        assert turned == pytest.approx(expected, abs=0.1)


def test_turns_are_named_by_the_traffic() -> None:
    assert traffic_turn("left", "right") == traffic_turn("right", "left") == "across"
    assert traffic_turn("right", "right") == traffic_turn("left", "left") == "near"
    assert traffic_turn("u_turn", "right") is None


@pytest.mark.parametrize("world", [cross(), tee(), ring(), ring(left_hand=True)])
def test_ways_reach_back_and_on_without_jumps(world: World) -> None:
    roads, junction = network(world)
    assert roads.passages(junction)
    for passage in roads.passages(junction):
        way = roads.way(passage)
        assert way.entry_m >= APPROACH_M - 1e-6
        assert way.path.length_m - way.exit_m >= DEPARTURE_M - 1.0
        assert 0.0 <= way.first_m < way.entry_m < way.exit_m < way.last_m <= way.path.length_m + 1.0
        steps = np.diff(way.xy_m, axis=0)
        turned = np.abs(wrap_angle(np.diff(np.arctan2(steps[:, 1], steps[:, 0]))))
        assert turned.max() < math.radians(40.0)
        # What lies between entry and exit is what the connections' own lines say.
        first = passage.connections[0].centerline[0]
        assert way.path.point_at(np.array([way.entry_m]))[0] == pytest.approx(first, abs=0.1)
        last = passage.connections[-1].centerline[-1]
        assert way.path.point_at(np.array([way.exit_m]))[0] == pytest.approx(last, abs=0.1)


def test_a_limit_holds_from_where_its_lane_begins() -> None:
    """A straight lane of two points begins where the one before ends."""
    slow, fast = STREET | {"maxspeed": "30"}, AVENUE | {"maxspeed": "70"}
    roads, junction = network(world_of(crossing(street=slow, avenue=fast)))
    for passage in roads.passages(junction):
        way = roads.way(passage)
        for lane_id, arc_m in (
            (passage.connections[0].from_lane_id, way.entry_m - 10.0),
            (passage.connections[-1].to_lane_id, way.exit_m + 10.0),
        ):
            node = np.searchsorted(way.path.arc_m, arc_m)
            lane = roads.lanes[lane_id]
            assert way.path.speed_limit_mps[node] == lane.speed_limit_mps.value


@pytest.mark.parametrize("left_hand", [False, True])
def test_a_ring_is_passed_from_each_arm_to_each_other(left_hand: bool) -> None:
    roads, junction = network(ring(left_hand=left_hand))
    passages = roads.passages(junction)
    ends = [(p.connections[0].from_lane_id, p.connections[-1].to_lane_id) for p in passages]
    assert len(set(ends)) == len(ends)
    assert collections.Counter(p.turn for p in passages) == {
        "straight": 2, "across": 2, "near": 2, None: 3,
    }  # fmt: skip
    # Three arms, east, north and west: back out by one's own arm is a turn without a name.
    for passage in passages:
        lanes = [passage.connections[0].to_lane_id, *(c.to_lane_id for c in passage.connections)]
        assert all(roads.lanes[lane].role == "ring" for lane in lanes[:-1])
        assert roads.lanes[lanes[-1]].role != "ring"


def test_who_circulates_goes_round_where_the_ego_enters() -> None:
    roads, junction = network(ring())
    entering = roads.passages(junction)[0].connections[0]
    way = roads.way_round(entering)
    assert way is not None
    merge = entering.centerline[-1]
    place = way.path.locate(merge[None], near_arc_m=np.array([way.exit_m]))
    assert abs(float(place.offset_m[0])) < 0.3
    around = way.path.point_at(np.arange(way.first_m, way.last_m, 1.0))
    radius = np.hypot(*around.T)
    assert radius.min() > 10.0
    assert radius.max() < 20.0
    # To the right-hand driver the ring is driven counter-clockwise.
    turn = np.unwrap(np.arctan2(around[:, 1], around[:, 0]))
    assert turn[-1] - turn[0] > 4 * math.pi


def test_lanes_of_one_direction_are_counted_to_the_kerb() -> None:
    roads = RoadNetwork(motorway())
    counts = collections.Counter(
        roads.lanes_to_kerb(passage)
        for junction in roads.world.junctions
        for passage in roads.passages(junction.summary.id)
    )
    assert set(counts) == {0, 1}


def test_edges_are_told_as_the_driver_sees_them() -> None:
    roads, _ = network(cross())
    for lane in roads.lanes.values():
        left, right = roads.edges_beside(lane.id)
        # The other direction's lane lies to the left, half a lane and the kerb to the right.
        assert left > 3.0 > 1.0 < -right < 2.5
