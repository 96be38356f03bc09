"""Paths through wide junctions keep to the lanes inside and turn where the roads meet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from contracts.arrays import Array
from world_gen.build import build_world
from world_gen.build_graph import build_road_graph
from world_gen.find_intersections import find_intersections
from world_gen.read_osm import read_map

MAPS = Path(__file__).parents[1] / "data" / "junctions"


def _path(name: str, first: str, last: str) -> Array:
    """Return the path between two named roads, in metres about the World's origin."""
    osm = read_map(MAPS / f"{name}.osm")
    graph = build_road_graph(osm)
    (junction,) = find_intersections(osm, graph)
    world = build_world(osm, graph, junction)
    road = {lane.id: lane.name for lane in world.lanes}
    (found,) = (
        c for c in world.connections
        if (road[c.from_lane_id], road[c.to_lane_id]) == (first, last)
    )  # fmt: skip
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
