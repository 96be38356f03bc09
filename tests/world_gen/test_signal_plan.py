"""Lights at drawn and real junctions: heads, groups, and plans without conflicting greens."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contracts.world import SignalPlan, World
from tests.world_gen.drawn_maps import AVENUE, CROSS, STREET, crossing, drawn_map, world_of
from world_gen.build import build_region, build_world
from world_gen.build_graph import build_road_graph
from world_gen.find_intersections import find_intersections
from world_gen.map_index import index_map
from world_gen.osm_map import LatLonBounds, OsmMap
from world_gen.read_osm import read_map
from world_gen.signal_plan import LEAST_GREEN_S, share_green

LIGHT = {"highway": "traffic_signals"}
MAPS = {
    "berlin": "osm-berlin-mitte/berlin-mitte.osm",
    "moritzplatz": "osm-berlin-moritzplatz/berlin-moritzplatz.osm",
    "kingsway": "osm-kingsway/kingsway_junction.osm",
    "badhersfeld": "osm-badhersfeld/badhersfeld.osm.xml.gz",
    "monaco": "osm-monaco/monaco.osm.gz",
}


def plan_of(world: World) -> SignalPlan:
    plan = world.junctions[0].plan
    assert plan is not None
    return plan


def check_plans(world: World) -> int:
    """Fail where a phase lets conflicting groups go; return the number of plans."""
    group_of = {c.id: c.signal_group_id for c in world.connections}
    meeting: dict[frozenset[str | None], set[str]] = {}
    for c in world.conflicts:
        pair = frozenset((group_of[c.first_id], group_of[c.second_id]))
        if len(pair) == 2 and None not in pair:
            meeting.setdefault(pair, set()).add(c.rule)
    plans = [junction.plan for junction in world.junctions if junction.plan is not None]
    named: list[str] = []
    for plan in (*plans, *world.crossing_plans):
        groups = [group.id for group in plan.groups]
        named += groups
        green = {name for phase in plan.phases for name in phase.green_group_ids}
        assert green == set(groups)
        assert all(phase.green_s >= LEAST_GREEN_S for phase in plan.phases)
        assert plan.amber_s in (3.0, 4.0, 5.0)
        assert plan.all_red_s >= 1.0
        step_s = plan.amber_s + plan.all_red_s
        assert sum(phase.green_s + step_s for phase in plan.phases) <= 180.0
        for phase in plan.phases:
            for a in phase.green_group_ids:
                for b in phase.green_group_ids:
                    if a < b:
                        assert meeting.get(frozenset((a, b)), set()) <= {"turn_across", "u_turn"}
    assert len(set(named)) == len(named)
    for junction in world.junctions:
        for group in junction.plan.groups if junction.plan else ():
            assert group.id.startswith(f"{junction.summary.id}:g")
            assert all(group_of[name] == group.id for name in group.connection_ids)
    assert {signal.group_id for signal in world.signals} <= set(named)
    governed = {lane for signal in world.signals for lane in signal.lane_ids}
    lit = {line.lane_id for line in world.stop_lines if line.control.value == "signal"}
    assert lit == governed
    return len(plans)


def with_turn_lanes(*letters: str) -> OsmMap:
    """Return a crossing whose roads in from these sides have a lane for left turns alone."""
    ends = {"E": 1, "N": 2, "W": 3, "S": 4}
    wide: Mapping[str, str] = {
        "lanes": "3", "lanes:forward": "2", "lanes:backward": "1",
        "turn:lanes:forward": "left|through;right",
    }  # fmt: skip
    ways = [
        (
            10 + end,
            [end, 0],
            {"highway": "secondary", "name": side} | (wide if side in letters else {}),
        )
        for side, end in ends.items()
    ]
    return drawn_map(CROSS, ways, node_tags={0: LIGHT})


def test_roads_that_face_each_other_drive_together():
    world = world_of(crossing(node_tags={0: LIGHT}))
    check_plans(world)
    plan = plan_of(world)
    assert [len(phase.green_group_ids) for phase in plan.phases] == [2, 2]
    assert len(plan.groups) == 4
    assert sum(phase.green_s + plan.amber_s + plan.all_red_s for phase in plan.phases) == 90.0
    assert plan.source == "default"
    assert all(signal.osm_nodes == (0,) for signal in world.signals)
    for signal in world.signals:
        # It looks away from the junction, and hangs beside the road out there.
        facing = np.array([np.cos(signal.yaw_rad), np.sin(signal.yaw_rad)])
        assert signal.position[:2] @ facing > 4.0
        assert 3.0 < signal.position[:2] @ [-facing[1], facing[0]] < 5.0


def test_a_busier_road_is_green_for_longer():
    wide = {"highway": "secondary", "name": "Street", "lanes": "4"}
    world = world_of(crossing(street=wide, node_tags={0: LIGHT}))
    street, avenue = sorted(phase.green_s for phase in plan_of(world).phases)[::-1]
    assert street > 1.5 * avenue


def test_turn_lanes_on_both_sides_get_a_phase_of_their_own():
    world = world_of(with_turn_lanes("E", "W"))
    check_plans(world)
    plan = plan_of(world)
    turn = {c.id: c.turn for c in world.connections}
    alone = {
        group.id
        for group in plan.groups
        if group.connection_ids and {turn[name] for name in group.connection_ids} == {"left"}
    }
    assert len(alone) == 2
    assert [set(phase.green_group_ids) for phase in plan.phases].count(alone) == 1
    assert len(plan.phases) == 3
    above = [signal for signal in world.signals if signal.id.endswith("above")]
    assert {signal.group_id for signal in above} == alone
    assert all(signal.position[2] > 5.0 for signal in above)
    middle = {lane.id: lane for lane in world.lanes}
    for signal in above:
        (lane_id,) = signal.lane_ids
        end = middle[lane_id].centerline[-1]
        assert np.hypot(*(signal.position[:2] - end)) < 1.0


def test_a_turn_lane_on_one_side_waits_for_oncoming_cars():
    world = world_of(with_turn_lanes("W"))
    check_plans(world)
    assert sorted(len(phase.green_group_ids) for phase in plan_of(world).phases) == [2, 3]


def test_wide_roads_have_heads_beside_and_above():
    wide = {"highway": "primary", "name": "Street", "oneway": "yes", "lanes": "3"}
    world = world_of(crossing(street=wide, node_tags={0: LIGHT}))
    mine = [signal for signal in world.signals if len(signal.lane_ids) == 3]
    assert sorted(float(signal.position[2]) for signal in mine) == [3.0, 5.5]
    assert len({signal.group_id for signal in mine}) == 1


def test_fast_roads_have_longer_amber():
    fast = {"highway": "primary", "name": "Street", "maxspeed": "70"}
    slow = plan_of(world_of(crossing(node_tags={0: LIGHT})))
    assert slow.amber_s == 3.0
    assert plan_of(world_of(crossing(street=fast, node_tags={0: LIGHT}))).amber_s == 5.0


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


def test_those_on_foot_go_when_the_crossed_road_waits():
    osm = drawn_map(
        CROSS | {5: (-9.0, 0.0)},
        [
            (11, [0, 1], STREET),
            (12, [0, 2], AVENUE),
            (13, [3, 5, 0], STREET),
            (14, [4, 0], AVENUE),
        ],
        node_tags={0: LIGHT, 5: {"highway": "crossing", "crossing": "traffic_signals"}},
    )
    world = world_of(osm)
    check_plans(world)
    plan = plan_of(world)
    (walk,) = [group for group in plan.groups if group.crossing_ids]
    assert walk.crossing_ids == ("n5",)
    street = {
        c.signal_group_id
        for c in world.connections
        if "w13" in c.from_lane_id or "w11" in c.from_lane_id
    }
    for phase in plan.phases:
        assert (walk.id in phase.green_group_ids) != bool(street & set(phase.green_group_ids))
    line = next(line for line in world.stop_lines if "w13" in line.lane_id)
    assert line.ends[0, 0] == pytest.approx(-12.0, abs=0.2)


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


@given(
    parts=st.lists(st.tuples(st.integers(0, 6), st.floats(5.0, 12.0)), min_size=1, max_size=7),
    total_s=st.floats(0.0, 120.0),
)
def test_green_is_shared_out_whole(parts, total_s):
    weights, least = [weight for weight, _ in parts], [least for _, least in parts]
    shared = share_green(weights, least, total_s)
    assert all(green >= lowest for green, lowest in zip(shared, least, strict=True))
    if any(weights):
        assert sum(shared) == pytest.approx(max(total_s, sum(least)), abs=0.26)


def whole_map(path: Path) -> tuple[OsmMap, World]:
    osm = read_map(path)
    lat, lon = np.array(list(osm.locations.values())).T
    bounds = LatLonBounds(lat.min() - 1e-3, lon.min() - 1e-3, lat.max() + 1e-3, lon.max() + 1e-3)
    return osm, build_region(osm, build_road_graph(osm), bounds)


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "plans"),
    [
        ("berlin", 10),
        ("moritzplatz", 3),
        ("kingsway", 3),
        pytest.param("badhersfeld", 19, marks=pytest.mark.judge),
        pytest.param("monaco", 4, marks=pytest.mark.judge),
    ],
)
def test_every_light_of_a_real_map_hangs_somewhere_in_a_sound_plan(
    data_dir: Path, name: str, plans: int
):
    osm, world = whole_map(data_dir / MAPS[name])
    on_roads = {node for e in build_road_graph(osm).edges if e.car for node in e.node_ids}
    tagged = {
        node for node in on_roads if osm.node_tags.get(node, {}).get("highway") == LIGHT["highway"]
    }
    assert tagged <= {node for signal in world.signals for node in signal.osm_nodes}
    assert check_plans(world) >= plans


@pytest.mark.real_data
def test_a_light_has_one_id_in_every_world(data_dir: Path):
    osm, town = whole_map(data_dir / MAPS["berlin"])
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    index = index_map(osm, graph, junctions)
    plans = {junction.summary.id: junction.plan for junction in town.junctions}
    signalled = [junction for junction in junctions if plans.get(junction.summary.id)]
    for junction in signalled[::3]:
        own = plan_of(build_world(osm, graph, junction, index=index, radius_m=100.0))
        elsewhere = plans[junction.summary.id]
        assert elsewhere is not None
        assert own.groups == elsewhere.groups
        assert own.phases == elsewhere.phases
