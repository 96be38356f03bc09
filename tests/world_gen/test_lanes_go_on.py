"""Where a road merely goes on, so does each of its lanes: into the next one or by a connection."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.contracts.world import World
from tests.world_gen.drawn_maps import STREET, crossing, drawn_map, world_of

COVERS = (
    "foretwin.world_gen.lanes.lane_curves",
    "foretwin.world_gen.lanes.reference_lines",
    "foretwin.world_gen.lanes.tapers",
    "foretwin.world_gen.lanes.transitions",
)

WIDE = {"highway": "secondary", "name": "Street"}
ONE_WAY = WIDE | {"oneway": "yes", "lanes": "2"}


def _world(first, second, *, at=(60.0, 0.0), far=(120.0, 0.0)) -> World:
    """Return the World of a T whose eastern road changes its tags at node 1."""
    nodes = {0: (0.0, 0.0), 1: at, 2: far, 3: (-90.0, 0.0), 4: (0.0, -90.0)}
    ways = [(11, [0, 1], first), (12, [1, 2], second), (13, [3, 0], WIDE), (14, [4, 0], STREET)]
    return world_of(drawn_map(nodes, ways))


def _leading_on(world: World) -> dict[str, set[str]]:
    """Return which lane leads to which beyond node 1; what meets there meets to 2 mm."""
    lanes = {lane.id: lane for lane in world.lanes}
    paths = {c.id: c for c in world.connections}
    onward: dict[str, set[str]] = {}
    for road in world.roads:
        for lane in (lanes[i] for i in road.lane_ids):
            if (road.from_place if lane.reverse else road.to_place) != "1":
                continue
            onward[lane.id] = set()
            for name in lane.successor_ids:
                target = lanes[name] if name in lanes else lanes[paths[name].to_lane_id]
                begin = (lanes | paths)[name].centerline[0]
                np.testing.assert_allclose(begin, lane.centerline[-1], atol=2e-3)
                onward[lane.id].add(target.id)
    return {_short(a): {_short(b) for b in bs} for a, bs in onward.items()}


def _short(lane_id: str) -> str:
    way, *_, lane = lane_id.split(".")
    return f"{way}.{lane}"


def test_a_turn_lane_becomes_the_centre_lane_for_turns():
    first = WIDE | {
        "lanes": "3",
        "lanes:forward": "2",
        "lanes:backward": "1",
        "turn:lanes:forward": "left|through;right",
    }
    second = WIDE | {"lanes": "3", "lanes:both_ways": "1", "turn:lanes:both_ways": "left"}
    assert _leading_on(_world(first, second)) == {
        "w11.f0": {"w12.centre"},
        "w11.f1": {"w12.f0"},
        "w12.b0": {"w11.b0"},
    }


@pytest.mark.parametrize("more", [{"width:lanes": "3|3|3.5"}, {"lanes": "4"}])
def test_arrows_for_what_comes_next_end_no_lane(more):
    first = ONE_WAY | {"lanes": "3", "turn:lanes": "left|through|right"}
    onward = _leading_on(_world(first, first | {"turn:lanes": ""} | more))
    assert onward.keys() == {"w11.f0", "w11.f1", "w11.f2"}
    assert all(onward.values())
    lanes = int(more.get("lanes", 3))
    assert set().union(*onward.values()) == {f"w12.f{i}" for i in range(lanes)}


def test_a_lane_whose_side_road_the_map_lacks_leads_back():
    first = ONE_WAY | {"lanes": "3", "turn:lanes": "left|through|right"}
    assert _leading_on(_world(first, WIDE | {"oneway": "yes", "lanes": "1"})) == {
        "w11.f0": {"w12.f0"},
        "w11.f1": {"w12.f0"},
        "w11.f2": {"w12.f0"},
    }


def test_a_bus_lane_ends_in_a_lane_for_all_but_none_for_all_in_it():
    buses = ONE_WAY | {"bus:lanes": "|designated"}
    assert _leading_on(_world(buses, ONE_WAY))["w11.f1"] == {"w12.f1"}
    assert _leading_on(_world(ONE_WAY, buses))["w11.f1"] == set()


@pytest.mark.parametrize("bend_m", [0.0, 12.0, -12.0])
def test_a_transition_around_a_bend_leaves_along_the_next_lanes(bend_m):
    moving = ONE_WAY | {"placement": "transition"}
    before = ONE_WAY | {"placement": "right_of:1"}
    world = _world(before, moving, at=(60.0, 0.0), far=(100.0, bend_m))
    assert _leading_on(world) == {"w11.f0": {"w12.f0"}, "w11.f1": {"w12.f1"}}
    world = _world(moving, ONE_WAY | {"placement": "right_of:2"}, far=(100.0, bend_m))
    assert _leading_on(world) == {"w11.f0": {"w12.f0"}, "w11.f1": {"w12.f1"}}


def test_lanes_meet_in_a_bend_between_two_short_pieces():
    world = _world(ONE_WAY, ONE_WAY | {"maxspeed": "30"}, at=(25.0, -1.0), far=(25.4, 20.0))
    assert _leading_on(world) == {"w11.f0": {"w12.f0"}, "w11.f1": {"w12.f1"}}


@pytest.mark.parametrize(
    ("at", "far", "before_m", "behind_m"),
    [
        ((60.0, 0.0), (140.0, 0.0), 11.375, 11.375),
        ((60.0, 0.0), (80.0, 0.0), 16.75, 6.0),  # what a short road has no room for
        ((60.0, 0.0), (70.0, 0.0), 18.0, 3.0),  # and no more than a share of each
    ],
)
def test_a_lane_more_begins_behind_a_taper_seven_times_as_long_as_it_is_wide(
    at, far, before_m, behind_m
):
    wider = ONE_WAY | {"placement": "right_of:1", "lanes": "3"}
    world = _world(ONE_WAY | {"placement": "right_of:1"}, wider, at=at, far=far)
    lanes = {lane.id: lane for lane in world.lanes}
    paths = [c for c in world.connections if c.place_id == "1"]
    widest = max(paths, key=lambda c: abs(c.centerline[-1, 1] - c.centerline[0, 1]))
    start, end = lanes[widest.from_lane_id].centerline[-1], lanes[widest.to_lane_id].centerline[0]
    assert abs(end[1] - start[1]) == pytest.approx(3.25, abs=0.01)
    assert at[0] - start[0] == pytest.approx(before_m, abs=0.1)
    assert end[0] - at[0] == pytest.approx(behind_m, abs=0.1)
    if before_m + behind_m > 22.0:
        assert _turned_rad(widest.centerline) < math.radians(16.0)


def test_a_lane_more_takes_more_of_short_roads_than_to_be_steeper_than_one_in_four():
    """20 and 8 m gave 8.4 m for it: cars turned by 32° for a lane beside theirs."""
    one_way = ONE_WAY | {"placement": "right_of:1"}
    nodes = {0: (0.0, 0.0), 5: (60.0, 0.0), 1: (80.0, 0.0), 2: (88.0, 0.0)}
    nodes |= {3: (-90.0, 0.0), 4: (0.0, -90.0)}
    ways = [(11, [0, 5], one_way), (15, [5, 1], one_way | {"maxspeed": "30"})]
    ways += [(12, [1, 2], one_way | {"lanes": "3"}), (13, [3, 0], WIDE), (14, [4, 0], STREET)]
    paths = [c for c in world_of(drawn_map(nodes, ways)).connections if c.place_id == "1"]
    widest = max(paths, key=lambda c: abs(c.centerline[-1, 1] - c.centerline[0, 1]))
    assert widest.centerline[0, 0] == pytest.approx(80.0 - 8.2, abs=0.1)
    assert widest.centerline[-1, 0] == pytest.approx(80.0 + 4.8, abs=0.1)
    assert _turned_rad(widest.centerline) < math.radians(26.0)


def _turned_rad(centerline: np.ndarray) -> float:
    steps = np.diff(centerline, axis=0)
    return float(np.abs(np.arctan2(steps[:, 1], steps[:, 0])).max())


def test_a_lane_that_ends_does_so_over_as_long_a_taper():
    narrow = ONE_WAY | {"placement": "right_of:1"}
    world = _world(narrow | {"lanes": "3"}, narrow, at=(60.0, 0.0), far=(140.0, 0.0))
    ends = [lane.centerline[-1, 0] for lane in world.lanes if lane.id.startswith("w11.")]
    assert ends == pytest.approx([60.0 - 11.375] * 3, abs=0.1)


@pytest.mark.parametrize(
    ("tags", "end_m"),
    [
        ({"highway": "traffic_signals", "traffic_signals:direction": "forward"}, 52.3),
        ({"highway": "crossing", "crossing": "zebra"}, 54.0),  # 6 m before the place in any case
        ({"highway": "give_way", "direction": "backward"}, 48.6),  # for those who come
    ],
)
def test_a_taper_leaves_lanes_to_a_light_and_to_a_crossing(tags, end_m):
    nodes = {0: (0.0, 0.0), 9: (52.0, 0.0), 1: (60.0, 0.0), 2: (140.0, 0.0)}
    nodes |= {3: (-90.0, 0.0), 4: (0.0, -90.0)}
    wider = ONE_WAY | {"placement": "right_of:1", "lanes": "3"}
    ways = [(11, [0, 9, 1], ONE_WAY | {"placement": "right_of:1"}), (12, [1, 2], wider)]
    ways += [(13, [3, 0], WIDE), (14, [4, 0], STREET)]
    world = world_of(drawn_map(nodes, ways, node_tags={9: tags}))
    ends = [lane.centerline[-1, 0] for lane in world.lanes if lane.id.startswith("w11.")]
    assert max(ends) == pytest.approx(end_m, abs=0.1)


@pytest.mark.parametrize(("width_m", "runs_on"), [("2.8", True), ("4", False)])
def test_a_lane_that_widens_in_the_middle_of_its_road_does_so_over_a_way(
    width_m: str, runs_on: bool
) -> None:
    one_way = STREET | {"oneway": "yes"}
    world = world_of(
        crossing(
            extra_nodes={5: (140.0, 20.0)},
            extra_ways=[(15, [1, 5], one_way | {"width": width_m})],
            street=one_way,
        )
    )
    widening = next(lane for lane in world.lanes if lane.osm_way == 15)
    before = next(lane for lane in world.lanes if lane.osm_way == 11)
    assert (widening.id in before.successor_ids) == runs_on
    if not runs_on:
        (way,) = (c for c in world.connections if c.to_lane_id == widening.id)
        assert way.from_lane_id == before.id
        assert np.hypot(*(way.centerline[-1] - way.centerline[0])) > 3.0
