"""Signalled junctions next to each other are run by one controller."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.signals import SignalPlan
from foretwin.contracts.world import World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.rules.signal_systems import NEAR_M
from tests.world_gen.drawn_maps import drawn_map
from tests.world_gen.green_together import green_together
from tests.world_gen.plan_checks import check_plans
from tests.world_gen.where_lanes_lead import maps_in, whole_world

LIGHT = {"highway": "traffic_signals"}


def _two(apart_m: float, *, third_arm: bool = True) -> World:
    """Return Main Road (ways 11, 12, 13 from west to east) with lights where Left Street (14, 15)
    and Right Street (6, 7: first by number) meet it."""
    nodes = {0: (0.0, 0.0), 1: (apart_m, 0.0), 2: (-120.0, 0.0), 3: (apart_m + 120.0, 0.0)}
    nodes |= {4: (0.0, 120.0), 5: (0.0, -120.0), 6: (apart_m, 120.0), 7: (apart_m, -120.0)}
    main = {"highway": "primary", "name": "Main Road"}
    side = {"highway": "secondary", "name": "Left Street"}
    ways = [
        (11, [2, 0], main),
        (12, [0, 1], main),
        (13, [1, 3], main),
        (14, [4, 0], side),
        (15, [5, 0], side),
        (6, [6, 1], side | {"name": "Right Street"}),
    ]
    if third_arm:
        ways.append((7, [7, 1], side | {"name": "Right Street"}))
    osm = drawn_map(nodes, ways, node_tags={0: LIGHT, 1: LIGHT})
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    assert len(junctions) == 2
    index = index_map(osm, graph, junctions)
    return build_world(osm, graph, junctions[0], index=index, radius_m=250.0)


def _plans(world: World) -> tuple[SignalPlan, SignalPlan]:
    first, second = (junction.plan for junction in world.junctions)
    assert first is not None
    assert second is not None
    return first, second


def _times(plan: SignalPlan) -> tuple[list[float], float, float]:
    return [phase.green_s for phase in plan.phases], plan.amber_s, plan.all_red_s


def _group(world: World, first_way: int, to_way: int) -> str:
    way = {lane.id: lane.osm_way for lane in world.lanes}
    found = {
        c.signal_group_id
        for c in world.connections
        if (way[c.from_lane_id], way[c.to_lane_id]) == (first_way, to_way)
    }
    (name,) = found
    assert name is not None
    return name


@pytest.mark.parametrize("third_arm", [True, False])
def test_near_junctions_change_together_and_let_go_on_who_was_let_go(third_arm: bool):
    world = _two(NEAR_M - 5.0, third_arm=third_arm)
    left, right = _plans(world)
    assert _times(left) == _times(right)
    for before, after in (((11, 12), (12, 13)), ((13, 12), (12, 11))):
        here, there = _group(world, *before), _group(world, *after)
        phases = zip(left.phases, right.phases, strict=True)
        both = [(*a.green_group_ids, *b.green_group_ids) for a, b in phases]
        let_go = [there in names for names in both if here in names]
        assert let_go
        assert all(let_go)
    assert check_plans(world) == 2
    assert green_together(world).found == ()


def test_junctions_farther_apart_have_plans_of_their_own():
    left, right = _plans(_two(NEAR_M + 25.0, third_arm=False))
    assert len(left.phases) == len(right.phases) == 2
    own = _two(NEAR_M - 5.0, third_arm=False)
    assert _plans(own)[0].groups == left.groups


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "members"),
    [
        ("leeds", ("n615978081", "n643951", "n9823132")),
        pytest.param("liechtenstein", ("n315636894", "n315636895"), marks=pytest.mark.judge),
    ],
)
def test_real_neighbours_run_in_step(data_dir: Path, name: str, members: tuple[str, ...]):
    (path,) = [path for path in maps_in(data_dir) if name in str(path)]
    plans = {junction.summary.id: junction.plan for junction in whole_world(path).junctions}
    mine = [plan for junction in members if (plan := plans[junction]) is not None]
    assert len(mine) == len(members)
    assert len({str(_times(plan)) for plan in mine}) == 1
    for plan in mine:
        for group in plan.groups:
            green = [group.id in phase.green_group_ids for phase in plan.phases]
            assert any(green)
            assert not all(green)
