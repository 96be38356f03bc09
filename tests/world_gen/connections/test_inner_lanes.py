"""Paths through wide junctions keep to the lanes inside and turn where the roads meet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import LineString

from foretwin.contracts.arrays import Array
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.drawn_maps import drawn_map, world_of

MAPS = Path(__file__).parents[2] / "data" / "junctions"


def _path(name: str, first: str, last: str) -> Array:
    """Return the path between two named roads, in metres about the World's origin."""
    osm = read_map(MAPS / f"{name}.osm")
    graph = build_road_graph(osm)
    (junction,) = find_intersections(osm, graph)
    world = build_world(osm, graph, junction)
    road = {lane.id: lane.name for lane in world.lanes}
    (found,) = (
        c for c in world.connections if (road[c.from_lane_id], road[c.to_lane_id]) == (first, last)
    )
    return found.centerline


@pytest.mark.parametrize(
    ("first", "last", "lane_y_m"), [("Südweg", "Nordweg", -1.6), ("Nordweg", "Südweg", 1.6)]
)
def test_who_crosses_a_staggered_junction_drives_along_its_middle(first, last, lane_y_m):
    path = _path("02_staggered", first, last)
    middle = path[np.abs(path[:, 0]) < 2.5]
    assert len(middle) >= 2
    assert np.allclose(middle[:, 1], lane_y_m, atol=0.2)


def test_a_left_turn_past_a_slip_road_goes_through_the_node():
    path = _path("09_slip_lane", "Ostweg", "Südweg")
    # The corner that the old sweep cut off lies 12 m from the node on both roads.
    assert not ((path[:, 0] > path[:, 0].min() + 11.0) & (path[:, 1] < 0.0)).any()


@pytest.mark.parametrize("turn", ["left", "through", "right"])
def test_lanes_that_turn_side_by_side_stay_apart_on_a_single_lane_inside(turn):
    """Two dual carriageways cross, 24 m apart; from the south two lanes do the same."""
    plain = {"highway": "primary", "oneway": "yes", "lanes": "1"}
    street, avenue = plain | {"name": "Street"}, plain | {"name": "Avenue"}
    wide = {"lanes": "2", "turn:lanes": f"{turn}|{turn}"}
    nodes = {
        1: (-12.0, -12.0),
        2: (12.0, -12.0),
        3: (12.0, 12.0),
        4: (-12.0, 12.0),
        11: (-120.0, -12.0),
        12: (120.0, -12.0),
        13: (120.0, 12.0),
        14: (-120.0, 12.0),
        21: (12.0, -120.0),
        22: (12.0, 120.0),
        23: (-12.0, 120.0),
        24: (-12.0, -120.0),
    }
    lights = {node: {"highway": "traffic_signals"} for node in (1, 2, 3, 4)}
    legs = [
        (30, [11, 1], street),
        (31, [1, 2], street),
        (32, [2, 12], street | {"lanes": "2"}),
        (33, [13, 3], street),
        (34, [3, 4], street),
        (35, [4, 14], street | {"lanes": "2"}),
        (40, [21, 2], avenue | wide),
        (41, [2, 3], avenue),
        (42, [3, 22], avenue | {"lanes": "2"}),
        (43, [23, 4], avenue),
        (44, [4, 1], avenue),
        (45, [1, 24], avenue),
    ]
    world = world_of(drawn_map(nodes, legs, node_tags=lights))
    turns = "straight" if turn == "through" else turn
    first, second = (
        LineString(c.centerline)
        for c in world.connections
        if c.from_lane_id.startswith("w40.") and c.turn == turns
    )
    assert first.distance(second) > 2.4
