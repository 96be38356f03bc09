"""Worlds of drawn junctions: lanes, legal movements, control, islands, buildings."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shapely.geometry import LineString, Point, Polygon

from foretwin.contracts.codec import content_bytes, decode, encode
from foretwin.contracts.world import ATTRIBUTION, World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import (
    AVENUE,
    IRELAND,
    STREET,
    crossing,
    drawn_map,
    roundabout,
    world_of,
)
from tests.world_gen.sketch import star

COVERS = (
    "foretwin.world_gen.connections.lane_connections",
    "foretwin.world_gen.lanes.cluster",
    "foretwin.world_gen.lanes.clusters",
    "foretwin.world_gen.polygon_areas",
)

TURNS = {"straight": 4, "left": 4, "right": 4}


def _turns(world: World) -> dict[str, int]:
    found: dict[str, int] = {}
    for connection in world.connections:
        found[connection.turn] = found.get(connection.turn, 0) + 1
    return found


def _headings_meet(world: World) -> float:
    """Return the largest bend in radians between lanes and the connections between them."""
    lanes = {lane.id: lane.centerline for lane in world.lanes}
    worst = 0.0
    for c in world.connections:
        a, b = lanes[c.from_lane_id], lanes[c.to_lane_id]
        for u, v in (
            (a[-1] - a[-2], c.centerline[1] - c.centerline[0]),
            (c.centerline[-1] - c.centerline[-2], b[1] - b[0]),
        ):
            worst = max(worst, abs(math.atan2(u[0] * v[1] - u[1] * v[0], u @ v)))
    return worst


def test_a_plain_crossing_has_twelve_movements():
    world = world_of(crossing())
    assert len(world.lanes) == 8
    assert {lane.role for lane in world.lanes} == {"approach", "exit"}
    assert _turns(world) == TURNS
    assert len(world.junctions[0].arms) == 4
    assert all((arm.lanes_in, arm.lanes_out) == (1, 1) for arm in world.junctions[0].arms)
    assert _headings_meet(world) < math.radians(6.0)
    assert world.attribution == ATTRIBUTION


def test_lanes_keep_right_or_left_of_the_road():
    for origin, side in ((None, -1.5), (IRELAND, 1.5)):
        world = world_of(crossing() if origin is None else crossing(origin=origin))
        east_in = next(
            lane for lane in world.lanes if lane.role == "approach" and lane.centerline[0][0] > 50.0
        )
        # Driven to the west: right of the road is north.
        assert east_in.centerline[-1][1] == pytest.approx(-side, abs=0.05)


def test_connections_lie_on_the_road_and_turn_no_tighter_than_four_metres():
    world = world_of(crossing())
    road = [Polygon(area.outline, area.holes).buffer(0.06) for area in world.road_surface]
    for connection in world.connections:
        line = LineString(connection.centerline)
        assert any(area.contains(line.buffer(1.0, cap_style="flat")) for area in road)
        if connection.turn == "right":
            assert line.length > 4.0 * math.pi / 2


def test_a_restriction_forbids_and_a_mandatory_turn_leaves_one():
    no_left = world_of(
        crossing(
            relations=[
                (
                    1,
                    [("w", 13, "from"), ("n", 0, "via"), ("w", 12, "to")],
                    {"type": "restriction", "restriction": "no_left_turn"},
                )
            ]
        )
    )
    assert _turns(no_left) == TURNS | {"left": 3}
    only = world_of(
        crossing(
            relations=[
                (
                    1,
                    [("w", 13, "from"), ("n", 0, "via"), ("w", 11, "to")],
                    {"type": "restriction", "restriction": "only_straight_on"},
                )
            ]
        )
    )
    assert _turns(only) == TURNS | {"left": 3, "right": 3}


def test_a_restriction_not_for_cars_changes_nothing():
    members = [("w", 13, "from"), ("n", 0, "via"), ("w", 12, "to")]
    tags = {"type": "restriction", "restriction": "no_left_turn", "except": "motorcar;psv"}
    assert _turns(world_of(crossing(relations=[(1, members, tags)]))) == TURNS


def test_a_one_way_street_is_entered_and_left_one_way():
    world = world_of(crossing(street=STREET | {"oneway": "yes"}))
    # From the west 3 movements, from north and south each straight on and into the east.
    assert len(world.connections) == 7
    assert {lane.direction_source for lane in world.lanes if lane.name == "Street"} == {"tagged"}


def test_turn_lanes_are_obeyed():
    street = STREET | {
        "lanes": "3",
        "lanes:forward": "2",
        "lanes:backward": "1",
        "turn:lanes:forward": "left|through;right",
    }
    world = world_of(crossing(street=street))
    from_west = [lane for lane in world.lanes if lane.role == "approach" and lane.osm_way == 13]
    left, right = sorted(from_west, key=lambda lane: -lane.centerline[-1][1])
    turns = {
        lane.id: sorted(c.turn for c in world.connections if c.from_lane_id == lane.id)
        for lane in from_west
    }
    assert turns == {left.id: ["left"], right.id: ["right", "straight"]}
    assert (left.turns, left.turns_source) == (("left",), "tagged")
    assert (left.right_id, right.left_id) == (right.id, left.id)


@pytest.mark.parametrize("left_hand", [False, True])
def test_a_roundabout_is_driven_by_its_ring(left_hand):
    osm = roundabout(origin=IRELAND, clockwise=True) if left_hand else roundabout()
    world = world_of(osm)
    assert world.intersection.kind == "roundabout"
    roles = [lane.role for lane in world.lanes]
    assert roles.count("approach") == roles.count("exit") == 3
    lanes = {lane.id: lane for lane in world.lanes}
    next_ids = {lane.id: set(lane.successor_ids) for lane in world.lanes}
    next_ids |= {c.id: {c.to_lane_id} for c in world.connections}
    exits = {lane.id for lane in world.lanes if lane.role == "exit"}
    for lane in world.lanes:
        if lane.role != "approach":
            continue
        reached, todo = set(), [lane.id]
        while todo:
            for step in next_ids[todo.pop()] - reached:
                reached.add(step)
                todo.append(step)
        assert exits <= reached
    ring = [lane for lane in world.lanes if lane.role == "ring"]
    for lane in ring:
        a, b = lane.centerline[0], lane.centerline[-1]
        assert (a[0] * b[1] - a[1] * b[0] > 0.0) != left_hand
    (island,) = world.islands
    assert Polygon(island.outline).contains(Point(0, 0))
    for path in [*(lane.centerline for lane in ring), *(c.centerline for c in world.connections)]:
        assert not LineString(path).buffer(0.9).intersects(Polygon(island.outline))
    entering = [c for c in world.connections if lanes[c.from_lane_id].role == "approach"]
    assert {c.control for c in entering} == {"give_way"}
    on_ring = {c.id for c in world.connections if lanes[c.from_lane_id].role == "ring"}
    assert all(set(c.yields_to) and set(c.yields_to) <= on_ring for c in entering)


def test_lanes_go_on_where_a_street_changes_its_tags():
    osm = drawn_map(
        {0: (0.0, 0.0), 1: (40.0, 0.0), 5: (90.0, 5.0), 2: (0.0, 90.0), 3: (-90.0, 0.0)},
        [
            (11, [0, 1], STREET),
            (15, [1, 5], STREET | {"maxspeed": "30"}),
            (12, [0, 2], AVENUE),
            (13, [3, 0], STREET),
        ],
    )
    lanes = {lane.id: lane for lane in world_of(osm).lanes}
    (away,) = (lane for lane in lanes.values() if lane.osm_way == 11 and lane.role == "exit")
    (onward,) = (lanes[i] for i in away.successor_ids)
    assert onward.osm_way == 15
    np.testing.assert_allclose(away.centerline[-1], onward.centerline[0], atol=2e-3)


def test_a_wider_stretch_is_reached_by_tapers():
    wide = STREET | {"lanes": "3", "lanes:forward": "1", "lanes:backward": "2"}
    osm = drawn_map(
        {0: (0.0, 0.0), 1: (40.0, 0.0), 5: (90.0, 0.0), 2: (0.0, 90.0), 3: (-90.0, 0.0)},
        [
            (11, [0, 1], wide),
            (15, [1, 5], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 0], STREET),
        ],
    )
    world = world_of(osm)
    reached = {c.to_lane_id for c in world.connections}
    toward = [lane.id for lane in world.lanes if lane.osm_way == 11 and lane.role == "approach"]
    assert len(toward) == 2
    assert set(toward) <= reached
    assert _headings_meet(world) < math.radians(6.0)


def test_crossings_span_the_carriageway():
    osm = drawn_map(
        {0: (0.0, 0.0), 1: (20.0, 0.0), 5: (90.0, 0.0), 2: (0.0, 90.0), 3: (-90.0, 0.0)},
        [(11, [0, 1, 5], STREET), (12, [0, 2], AVENUE), (13, [3, 0], STREET)],
        node_tags={1: {"highway": "crossing", "crossing": "zebra"}},
    )
    (zebra,) = world_of(osm).crossings
    assert (zebra.kind.value, zebra.kind.source, zebra.osm_node) == ("zebra", "tagged", 1)
    assert np.hypot(*(zebra.line[1] - zebra.line[0])) == pytest.approx(6.0, abs=0.01)
    assert abs(zebra.line[:, 0] - 20.0).max() < 0.1


def test_a_building_in_the_way_is_cut_back_and_named():
    osm = crossing(
        extra_nodes={20: (30.0, -2.0), 21: (50.0, -2.0), 22: (50.0, -20.0), 23: (30.0, -20.0)},
        extra_ways=[(20, [20, 21, 22, 23, 20], {"building": "yes", "building:levels": "2"})],
    )
    world = world_of(osm)
    (building,) = world.buildings
    assert (building.height_m.value, building.height_m.source) == (6.0, "inferred")
    assert building.outline[:, 1].max() == pytest.approx(-3.0, abs=0.05)
    assert any("w20" in note for note in world.notes)


def test_the_same_map_has_the_same_world_to_the_last_bit():
    first, second = world_of(crossing()), world_of(crossing())
    assert first.id == second.id
    assert len(first.id) == 16
    again = decode(encode(first), World).message
    assert content_bytes(again) == content_bytes(first)
    assert world_of(crossing(), radius_m=80.0).id != first.id


def test_without_ground_a_world_is_the_same_road_network():
    osm = crossing()
    graph = build_road_graph(osm)
    (junction,) = find_intersections(osm, graph)
    whole = build_world(osm, graph, junction)
    network = build_world(osm, graph, junction, ground=False)
    assert whole.road_surface
    assert not network.road_surface
    assert not network.buildings
    for field in ("lanes", "connections", "conflicts", "stop_lines", "signals", "crossings"):
        ours, theirs = getattr(network, field), getattr(whole, field)
        assert list(map(content_bytes, ours)) == list(map(content_bytes, theirs)), field


def test_lanes_end_at_the_worlds_edge():
    world = world_of(crossing(), radius_m=40.0)
    assert max(np.hypot(*road.reference_line.T).max() for road in world.roads) <= 40.001
    # Lanes beside the middle of the road are cut square with it.
    assert max(np.hypot(*lane.centerline.T).max() for lane in world.lanes) <= 40.1


def test_roads_of_the_junction_that_begin_beyond_the_world_are_named():
    # Ways in and out begin some 25 m from the middle of the ring, whose radius is 20 m.
    near, far = (world_of(roundabout(), radius_m=radius_m) for radius_m in (22.0, 40.0))
    assert {lane.role for lane in near.lanes} == {"ring"}
    beyond = [note for note in near.notes if "begins beyond the World" in note]
    assert sorted(beyond) == [
        f"way {way}: begins beyond the World, 22 m about the junction; left out, with its turns"
        for way in sorted({lane.osm_way for lane in far.lanes if lane.role != "ring"})
    ]
    assert not any("beyond" in note for note in far.notes)


def test_a_radius_out_of_range_is_refused():
    osm = crossing()
    graph = build_road_graph(osm)
    (junction,) = find_intersections(osm, graph)
    with pytest.raises(ValueError, match="radius 5 m is not between 10 and 2000 m"):
        build_world(osm, graph, junction, radius_m=5)


def test_what_the_reader_left_out_is_told_in_the_world(tmp_path):
    sketch = star([0.0, 90.0, 200.0])
    sketch.node(50, 30.0, 30.0)
    sketch.way(300, [50, 1, 999], highway="footway")
    osm = sketch.read(tmp_path)
    (note,) = [n for n in world_of(osm).notes if "way 300" in n]
    assert note == "way 300: the map lacks its node 999; 2 of its 3 nodes are kept"
