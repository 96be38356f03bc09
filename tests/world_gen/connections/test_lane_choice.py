"""Every lane before a junction leads somewhere: where its arrow says, else where it lies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import pytest

from foretwin.contracts.world import World
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import GERMANY, IRELAND, crossing, drawn_map, world_of
from tests.world_gen.where_lanes_lead import lane_ends, maps_in, whole_world

Tags = Mapping[str, str]
TWO = {"lanes": "2", "oneway": "yes"}


def _ring(*, ring: Tags, entry: Tags, left_hand: bool = False, exit_there: bool = False) -> World:
    """Return a roundabout of 25 m radius that way 11 enters from the west, one-way; ways 12 and 13
    leave it to the east and, with `exit_there`, from the node of the entry."""
    turn = -1 if left_hand else 1
    angles = [turn * 2 * math.pi / 24 * i for i in range(24)]
    nodes = {100 + i: (25 * math.cos(a), 25 * math.sin(a)) for i, a in enumerate(angles)}
    nodes |= {1: (120.0, 0.0), 2: (-120.0, 0.0), 3: (-90.0, -turn * 80.0), 4: (0.0, turn * 120.0)}
    road = {"highway": "primary"}
    ways = [
        (10, [*range(100, 124), 100], road | {"junction": "roundabout"} | ring),
        (11, [2, 112], road | {"name": "Way in"} | entry),
        (12, [100, 1], road | {"name": "Way out", "oneway": "yes"}),
        (14, [106, 4], road | {"name": "Aside"}),
    ]
    if exit_there:
        ways.append((13, [112, 3], road | {"name": "Next out", "oneway": "yes"}))
    return world_of(drawn_map(nodes, ways, origin=IRELAND if left_hand else GERMANY))


def _leads(world: World, way: int, node: int | None = None) -> dict[str, set[tuple[int, str]]]:
    """Return to which (way, lane) each lane of a way leads, its lanes by their labels.

    Of a way that is cut at junctions, the piece that begins at a node.
    """
    begin = f"w{way}." if node is None else f"w{way}.{node}."
    lanes = {lane.id: lane for lane in world.lanes}
    found: dict[str, set[tuple[int, str]]] = {}
    for c in world.connections:
        start, end = lanes[c.from_lane_id], lanes[c.to_lane_id]
        if start.id.startswith(begin):
            label = start.id.rpartition(".")[2]
            found.setdefault(label, set()).add((end.osm_way, end.id.rpartition(".")[2]))
    return found


@pytest.mark.parametrize("left_hand", [False, True])
def test_both_lanes_of_an_entry_lead_into_a_ring_of_two_lanes(left_hand: bool):
    world = _ring(ring={"lanes": "2"}, entry=TWO, left_hand=left_hand)
    assert _leads(world, 11) == {"f0": {(10, "f0")}, "f1": {(10, "f1")}}
    assert lane_ends(world).dead == ()


def test_entering_lanes_join_those_of_the_ring_on_the_outside():
    nodes = {i: (40 * math.cos(a), 40 * math.sin(a)) for i in range(24) for a in [math.pi * i / 12]}
    nodes |= {101: (120.0, 0.0), 102: (-120.0, 0.0), 103: (0.0, 120.0)}
    road = {"highway": "primary"}
    ring = road | {"junction": "roundabout"}
    ways = [
        (10, [*range(12, 24), 0], ring | {"lanes": "4"}),
        (15, [*range(13)], ring | {"lanes": "2"}),
        (11, [102, 12], road | TWO),
        (12, [0, 101], road | TWO),
        (14, [6, 103], road),
    ]
    world = world_of(drawn_map(nodes, ways))
    assert _leads(world, 11) == {"f0": {(10, "f2")}, "f1": {(10, "f3")}}
    assert _leads(world, 15)["f0"] >= {(10, "f0")}
    assert {to for _, to in set().union(*_leads(world, 15).values())} <= {"f0", "f1"}


def test_an_arrow_straight_on_before_a_ring_means_to_stay_on_it():
    entry = TWO | {"turn:lanes": "through|right"}
    world = _ring(ring={"lanes": "2"}, entry=entry, exit_there=True)
    assert _leads(world, 11)["f0"] <= {(10, "f0"), (10, "f1")}
    assert _leads(world, 11)["f1"] == {(13, "f0")}
    later = _ring(ring={"lanes": "2"}, entry=entry)
    assert _leads(later, 11) == {"f0": {(10, "f0")}, "f1": {(10, "f1")}}


@pytest.mark.parametrize(
    ("arrows", "onward"),
    [
        # The map lacks the road to the left.
        ("left|through;right", {"f0": {(11, "f0")}, "f1": {(11, "f0"), (14, "b0")}}),
        # No straight on: the lane goes where it turns least.
        ("left|through", {"f0": {(12, "f0")}, "f1": {(14, "b0")}}),
    ],
)
def test_a_lane_whose_arrow_points_nowhere_leads_on(
    arrows: str, onward: dict[str, set[tuple[int, str]]]
):
    nodes = {0: (0.0, 0.0), 1: (100.0, 0.0), 2: (0.0, 100.0), 3: (-100.0, 0.0), 4: (0.0, -100.0)}
    road = {"highway": "primary"}
    ways = [
        (13, [3, 0], road | TWO | {"name": "Street", "turn:lanes": arrows}),
        (14, [4, 0], road | {"name": "South"}),
    ]
    missing_left = any(to[0] == 11 for mine in onward.values() for to in mine)
    ways.append((11, [0, 1], road | {"name": "Street"}) if missing_left else (12, [0, 2], road))
    world = world_of(drawn_map(nodes, ways))
    assert _leads(world, 13) == onward


def test_a_centre_lane_takes_no_tagged_lane_its_turn():
    street = {
        "highway": "primary",
        "name": "Street",
        "lanes": "4",
        "lanes:forward": "2",
        "lanes:backward": "1",
        "lanes:both_ways": "1",
        "turn:lanes:forward": "left|through;right",
    }
    world = world_of(crossing(street=street))
    found = _leads(world, 13)
    assert found["centre"] == found["f0"] == {(12, "f0")}
    assert lane_ends(world).dead == ()


def test_a_road_that_no_lane_leads_out_of_is_a_real_dead_end():
    against = {"highway": "residential", "oneway": "-1", "name": "Against"}
    nodes = {0: (0.0, 0.0), 1: (80.0, 0.0), 2: (160.0, 5.0), 3: (-90.0, 0.0), 4: (0.0, -90.0)}
    street = {"highway": "residential", "name": "Street"}
    ways = [(11, [0, 1], street), (12, [1, 2], against), (13, [3, 0], street), (14, [4, 0], street)]
    found = lane_ends(world_of(drawn_map(nodes, ways), radius_m=250.0))
    assert (found.dead, [lane.partition(".")[0] for lane in found.closed]) == ((), ["w11"])


@pytest.mark.real_data
@pytest.mark.parametrize(
    "name",
    ["austin", "badhersfeld", "grosser-stern", "mitte", "moritzplatz", "kingsway", "leeds",
     "monaco", pytest.param("liechtenstein", marks=pytest.mark.judge)],
)  # fmt: skip
def test_no_lane_of_a_real_map_ends_before_a_junction(data_dir: Path, name: str):
    (path,) = [path for path in maps_in(data_dir) if name in str(path)]
    found = lane_ends(whole_world(path))
    assert len(found.ends) > 50
    assert found.dead == ()


@pytest.mark.real_data
def test_a_lane_whose_road_lies_beyond_the_edge_is_led_nowhere_else(data_dir: Path):
    (path,) = [path for path in maps_in(data_dir) if "austin" in str(path)]
    osm = read_map(path)
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    (here,) = [j for j in junctions if j.summary.id == "n152456636"]
    index = index_map(osm, graph, junctions)
    wide, narrow = (
        _leads(build_world(osm, graph, here, index=index, radius_m=radius_m), 124953136, 4344958694)
        for radius_m in (80.0, 60.0)
    )
    assert wide["f2"] == {(366244289, "b1")}
    assert narrow == {lane: to for lane, to in wide.items() if lane != "f2"}
