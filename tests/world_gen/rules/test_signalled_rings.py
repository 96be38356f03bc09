"""A ring with lights: who goes round and who enters have their turns, in one plan."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.signals import SignalPhase
from foretwin.contracts.world import World
from foretwin.world_gen.rules.signal_state import colours_at
from tests.world_gen.drawn_maps import GERMANY, crossing, drawn_map, world_of
from tests.world_gen.green_together import green_together
from tests.world_gen.plan_checks import check_plans, plan_of
from tests.world_gen.where_lanes_lead import maps_in, whole_world

COVERS = ("foretwin.world_gen.rules.ring_exits",)

LIGHT = {"highway": "traffic_signals"}
FOOT = LIGHT | {"crossing": "traffic_signals"}
RADIUS_M = 40.0
BRITAIN = GeoPoint(53.0, -1.5)


def _ring(
    lights: Mapping[int, Mapping[str, str]], *, kind: str = "roundabout", left_hand: bool = False
) -> World:
    """Return a ring of two lanes: node 100 + i lies at 15 degrees times i, in driving direction.

    From the east way 11 enters at node 100 and 12 leaves from node 97 of the ring before it; from
    the west 13 enters at node 112 and 14 leaves from 109. Nodes 1 to 4 are 30 m out on them.
    """
    turn = -1 if left_hand else 1
    nodes = {}
    for i in range(24):
        a = turn * math.radians(15.0 * i)
        nodes[100 + i] = (RADIUS_M * math.cos(a), RADIUS_M * math.sin(a))
    for way, at, far in ((1, 100, 0.0), (2, 121, -45.0), (3, 112, 180.0), (4, 109, 135.0)):
        x, y = nodes[at]
        a = turn * math.radians(far)
        nodes[way] = (x + 30.0 * math.cos(a), y + 30.0 * math.sin(a))
        nodes[10 + way] = (x + 120.0 * math.cos(a), y + 120.0 * math.sin(a))
    road = {"highway": "primary", "oneway": "yes", "lanes": "2"}
    ring = {"highway": "primary", "junction": kind, "oneway": "yes", "lanes": "2"}
    ways = [
        (10, [*range(100, 124), 100], ring),
        (11, [11, 1, 100], road | {"name": "East"}),
        (12, [121, 2, 12], road | {"name": "East out"}),
        (13, [13, 3, 112], road | {"name": "West"}),
        (14, [109, 4, 14], road | {"name": "West out"}),
    ]
    origin = BRITAIN if left_hand else GERMANY
    return world_of(drawn_map(nodes, ways, node_tags=lights, origin=origin))


def _groups(world: World) -> dict[tuple[int, int], set[str | None]]:
    """Return the groups of the connections from one way to another."""
    way = {lane.id: lane.osm_way for lane in world.lanes}
    found: dict[tuple[int, int], set[str | None]] = {}
    for c in world.connections:
        pair = way[c.from_lane_id], way[c.to_lane_id]
        found.setdefault(pair, set()).add(c.signal_group_id)
    return found


@pytest.mark.parametrize("left_hand", [False, True])
def test_a_light_on_the_ring_stops_it_where_others_enter(left_hand: bool):
    world = _ring({122: LIGHT, 110: LIGHT}, left_hand=left_hand)
    groups = _groups(world)
    (east,), (west,) = groups[(11, 10)], groups[(13, 10)]
    going_round = groups[(10, 10)] - {None}
    assert None not in (east, west)
    assert len(going_round | {east, west}) == 4
    plan = plan_of(world)
    assert [set(phase.green_group_ids) for phase in plan.phases] in (
        [{east, west}, going_round],
        [going_round, {east, west}],
    )
    inferred = {line.control for line in world.stop_lines if line.lane_id.startswith("w11.")}
    assert {(control.value, control.source) for control in inferred} == {("signal", "inferred")}
    assert green_together(world).found == ()


def test_who_goes_round_without_a_light_keeps_the_way_of_a_roundabout():
    world = _ring({1: LIGHT})
    groups = _groups(world)
    assert groups[(10, 10)] == {None}
    assert None not in groups[(11, 10)]
    assert groups[(13, 10)] == {None}
    rules = {(c.rule, c.yields_id.split(".")[0]) for c in world.conflicts}
    assert rules >= {("roundabout", "w11"), ("roundabout", "w13")}
    assert ("roundabout", "w10") not in rules
    assert green_together(world).found == ()


def test_a_sign_on_the_ring_gives_no_right_of_way_to_it():
    sign = {"highway": "give_way", "direction": "forward"}
    world = _ring({122: sign, 110: sign}, kind="circular")
    crossing_pairs = [c for c in world.conflicts if c.rule != "merge_order"]
    assert crossing_pairs
    assert {(c.rule, c.yields_id.split(".")[0]) for c in crossing_pairs} == {("give_way", "w10")}


def test_lights_on_the_roads_out_change_with_the_ring():
    world = _ring({122: LIGHT, 110: LIGHT, 2: FOOT, 14: FOOT})
    plan = plan_of(world)
    names = [group.id for group in plan.groups]
    assert names == [f"n100:g{i}" for i in range(len(names))]
    drive, walk = names[-2:]
    assert plan.groups[-1].crossing_ids == ("n2",)
    assert {s.group_id for s in world.signals if s.osm_node == 2} == {drive}
    for phase in plan.phases:
        assert (drive in phase.green_group_ids) != (walk in phase.green_group_ids)
    # The other stands 120 m out, where nobody waits on the ring.
    assert [p.groups[0].id for p in world.crossing_plans] == ["n14:g0"]
    assert check_plans(world) == 1


@pytest.mark.parametrize(("left_hand", "red_amber_s"), [(False, 1.0), (True, 2.0)])
def test_red_and_amber_come_before_green_in_germany_and_longer_in_britain(
    left_hand: bool, red_amber_s: float
):
    plan = plan_of(_ring({122: LIGHT, 110: LIGHT}, left_hand=left_hand))
    assert plan.red_amber_s == red_amber_s <= plan.all_red_s


def test_red_and_amber_come_before_green_where_a_plan_has_them():
    plan = msgspec.structs.replace(plan_of(_ring({122: LIGHT, 110: LIGHT})), red_amber_s=1.0)
    first, second = (phase.green_group_ids for phase in plan.phases)
    step_s = plan.phases[0].green_s + plan.amber_s + plan.all_red_s
    assert {colours_at(plan, step_s - 0.5)[name] for name in second} == {"red_amber"}
    assert {colours_at(plan, step_s - 1.1)[name] for name in second} == {"red"}
    assert {colours_at(plan, step_s)[name] for name in second} == {"green"}
    assert {colours_at(plan, step_s - 0.5)[name] for name in first} == {"red"}
    later = msgspec.structs.replace(plan, offset_s=10.0)
    assert colours_at(later, step_s + 9.5) == colours_at(plan, step_s - 0.5)


def test_a_lane_in_the_middle_for_turns_has_the_light_of_its_road():
    street = {
        "highway": "primary",
        "name": "Street",
        "lanes": "3",
        "lanes:both_ways": "1",
        "turn:lanes:both_ways": "left",
    }
    world = world_of(crossing(street=street, node_tags={0: LIGHT}))
    (turning,) = [c for c in world.connections if c.from_lane_id.endswith("w13.3.0.centre")]
    assert turning.control == "signal"
    assert turning.signal_group_id is not None
    assert f"{turning.from_lane_id}:stop" in {line.id for line in world.stop_lines}
    assert green_together(world).found == ()


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("name", "junction", "lit", "entries"),
    [("grosser-stern", "n21487169", 42, 5), ("leeds", "n643907", 16, 4)],
)
def test_a_real_ring_is_lit_where_its_heads_hang(
    data_dir: Path, name: str, junction: str, lit: int, entries: int
):
    (path,) = [path for path in maps_in(data_dir) if name in str(path)]
    world = whole_world(path)
    mine = [c for c in world.connections if c.junction_id == junction]
    role = {lane.id: lane.role for lane in world.lanes}
    assert sum(c.signal_group_id is not None for c in mine) >= lit
    groups = {(role[c.from_lane_id], c.signal_group_id) for c in mine if c.signal_group_id}
    assert sum(kind == "approach" for kind, _ in groups) == entries
    assert green_together(world).found == ()


@pytest.mark.real_data
@pytest.mark.parametrize(
    "name",
    ["austin", "mitte", "moritzplatz", "kingsway",
     *(pytest.param(n, marks=pytest.mark.judge) for n in ("badhersfeld", "monaco", "liechtenstein",
                                                          "testfeld"))],
)  # fmt: skip
def test_no_plan_of_a_real_map_lets_cars_meet(data_dir: Path, name: str):
    (path,) = [path for path in maps_in(data_dir) if name in str(path)]
    found = green_together(whole_world(path))
    assert found.pairs > 20
    assert found.found == ()


def test_the_checker_tells_of_a_plan_that_lets_all_go_together():
    road = {"highway": "primary", "name": "Street"}
    world = world_of(crossing(street=road, avenue=road, node_tags={0: LIGHT}))
    assert green_together(world).found == ()
    junction = world.junctions[0]
    plan = plan_of(world)
    together = SignalPhase(green_s=40.0, green_group_ids=tuple(g.id for g in plan.groups))
    bad = msgspec.structs.replace(
        junction, plan=msgspec.structs.replace(plan, phases=(together, *plan.phases[1:]))
    )
    spoilt = msgspec.structs.replace(world, junctions=(bad,))
    assert any("green together" in word for word in green_together(spoilt).found)
    lost = world.connections[0]
    bare = msgspec.structs.replace(lost, signal_group_id=None, yields_to=())
    others = tuple(
        msgspec.structs.replace(c, yields_to=tuple(set(c.yields_to) - {lost.id}))
        for c in world.connections[1:]
    )
    spoilt = msgspec.structs.replace(world, connections=(bare, *others))
    assert any("without a light" in word for word in green_together(spoilt).found)
