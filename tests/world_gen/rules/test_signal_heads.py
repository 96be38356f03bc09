"""Which lights of a map are one, which serve a junction, and which stand away from all."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, crossing, drawn_map, world_of
from tests.world_gen.plan_checks import check_plans

COVERS = ("foretwin.world_gen.rules.control_devices",)

LIGHT = {"highway": "traffic_signals"}


def test_wide_roads_have_heads_beside_and_above():
    wide = {"highway": "primary", "name": "Street", "oneway": "yes", "lanes": "3"}
    world = world_of(crossing(street=wide, node_tags={0: LIGHT}))
    mine = [signal for signal in world.signals if len(signal.lane_ids) == 3]
    assert sorted(float(signal.position[2]) for signal in mine) == [3.0, 5.5]
    assert len({signal.group_id for signal in mine}) == 1


def test_several_nodes_before_one_line_are_one_light():
    nodes = {5: (-14.0, 0.0), 6: (-9.0, 0.0)}
    osm = drawn_map(
        CROSS | nodes,
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 5, 6, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={node: LIGHT | {"traffic_signals:direction": "forward"} for node in nodes},
    )
    world = world_of(osm)
    (tagged,) = [signal for signal in world.signals if signal.source == "tagged"]
    assert set(tagged.osm_nodes) == {5, 6}
    assert tagged.position[0] == pytest.approx(-14.0, abs=0.3)


def test_a_light_for_those_on_foot_away_from_junctions_stops_both_ways():
    osm = drawn_map(
        CROSS | {5: (-60.0, 0.0)},
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 5, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={5: LIGHT | {"crossing": "traffic_signals"}},
    )
    world = world_of(osm)
    assert world.intersection.control == "uncontrolled"
    assert world.junctions[0].plan is None
    assert {signal.group_id for signal in world.signals} == {"n5:g0"}
    assert sorted(float(signal.position[0]) for signal in world.signals) == [-63.0, -57.0]
    assert {round(abs(signal.yaw_rad), 2) for signal in world.signals} == {0.0, 3.14}
    (plan,) = world.crossing_plans
    assert plan.groups[1].crossing_ids == ("n5",)
    assert "signal" not in {c.control for c in world.connections}


def test_a_walkers_light_before_a_signalled_junction_is_the_light_of_its_road():
    """At 22 m it is too far for the junction by itself, but cars stop once and not twice."""
    nodes = {5: (-22.0, 0.0), 6: (12.0, 0.0), 7: (0.0, 12.0), 8: (0.0, -12.0)}
    facing = LIGHT | {"traffic_signals:direction": "forward"}
    osm = drawn_map(
        CROSS | nodes,
        [
            (11, [1, 6, 0], STREET),
            (12, [2, 7, 0], AVENUE),
            (13, [3, 5, 0], STREET),
            (14, [4, 8, 0], AVENUE),
        ],
        node_tags={5: LIGHT | {"crossing": "traffic_signals"}, 6: facing, 7: facing, 8: facing},
    )
    world = world_of(osm)
    check_plans(world)
    assert world.crossing_plans == ()
    assert {signal.osm_nodes for signal in world.signals} == {(5,), (6,), (7,), (8,)}
    line = next(line for line in world.stop_lines if "w13" in line.lane_id)
    assert line.ends[0, 0] == pytest.approx(-25.0, abs=0.3)


def test_a_light_on_the_one_way_road_out_stops_nobody_behind_the_junction():
    one_way = {**STREET, "oneway": "yes"}
    osm = drawn_map(
        CROSS | {5: (9.0, 0.0)},
        [
            (11, [0, 5, 1], one_way),
            (12, [0, 2], AVENUE),
            (13, [3, 0], one_way),
            (14, [4, 0], AVENUE),
        ],
        node_tags={0: LIGHT, 5: LIGHT | {"crossing": "traffic_signals"}},
    )
    world = world_of(osm)
    check_plans(world)
    assert world.crossing_plans == ()
    (straight,) = [signal for signal in world.signals if 5 in signal.osm_nodes]
    assert all("w13" in lane for lane in straight.lane_ids)


def test_the_light_of_a_junction_beyond_the_edge_is_not_one_for_walkers():
    far = {5: (-140.0, 0.0), 6: (-170.0, 0.0), 7: (-170.0, 90.0), 8: (-260.0, 0.0)}
    osm = drawn_map(
        CROSS | far,
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [6, 5, 3, 0], STREET),
            (14, [4, 0], AVENUE),
            (15, [7, 6], AVENUE),
            (16, [8, 6], STREET),
        ],
        node_tags={5: LIGHT | {"traffic_signals:direction": "backward"}},
    )
    graph = build_road_graph(osm)
    near, beyond = sorted(find_intersections(osm, graph), key=lambda found: min(found.nodes))
    assert beyond.lights == {5}
    index = index_map(osm, graph, (near, beyond))
    world = build_world(osm, graph, near, index=index)
    assert world.signals == ()
    assert world.crossing_plans == ()


def test_a_light_behind_a_junction_whose_turns_take_its_place_stops_cars_where_lanes_begin():
    light = LIGHT | {"traffic_signals:direction": "forward"}
    wide = {"highway": "primary", "name": "Street", "lanes": "6"}
    ways = [(11, [0, 20, 1], wide), (13, [3, 0], wide), (12, [0, 2], AVENUE), (14, [4, 0], AVENUE)]
    world = world_of(drawn_map(CROSS | {20: (8.0, 0.0)}, ways, node_tags={20: light}))
    lines = [line for line in world.stop_lines if line.id.endswith(":light20")]
    begins = {lane.id: lane.centerline[0] for lane in world.lanes}
    assert len(lines) == 3
    for line in lines:
        assert np.hypot(*(line.ends.mean(axis=0) - begins[line.lane_id])) < 0.6


def test_a_light_at_a_corner_whose_turns_take_room_stops_cars_where_lanes_end():
    nodes = CROSS | {30: (-90.0, 50.0), 31: (-20.0, 50.0), 32: (-20.0, 110.0)}
    ways = [
        (11, [0, 1], STREET), (13, [3, 0], STREET), (12, [0, 2], AVENUE), (14, [4, 0], AVENUE),
        (21, [30, 31], {"highway": "primary", "name": "Main Road"}),
        (22, [31, 32], {"highway": "primary", "name": "Other Road"}),
    ]  # fmt: skip
    world = world_of(drawn_map(nodes, ways, node_tags={31: LIGHT}))
    lines = [line for line in world.stop_lines if line.id.endswith(":light31")]
    ends = {lane.id: lane.centerline[-1] for lane in world.lanes}
    assert len(lines) == 2
    for line in lines:
        assert np.hypot(*(line.ends.mean(axis=0) - ends[line.lane_id])) < 0.6
