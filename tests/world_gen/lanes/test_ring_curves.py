"""A ring that the map draws by eight points is a circle, wherever roads meet it."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.world_gen.lanes.ring_curves import ring_curves
from foretwin.world_gen.roads.road_graph import RoadEdge
from tests.world_gen.drawn_maps import world_of
from tests.world_gen.test_circular_junctions import roundabout

RADIUS_M = 15.0


def ring_edges(folder: Path) -> dict[int, RoadEdge]:
    return {edge.index: edge for edge in roundabout().graph(folder).edges}


def test_a_ring_of_eight_points_is_a_circle(tmp_path: Path) -> None:
    edges = ring_edges(tmp_path)
    curved = ring_curves(edges)
    points = np.concatenate([edge.xy_m for edge in curved.values()])
    assert len(points) > 100
    around = np.concatenate([edge.xy_m for i, edge in edges.items() if i in curved])
    middle = (around.min(axis=0) + around.max(axis=0)) / 2.0
    assert np.hypot(*(points - middle).T) == pytest.approx(RADIUS_M, abs=0.02)
    assert sum(edge.length_m for edge in curved.values()) == pytest.approx(94.25, abs=0.1)


def test_its_own_nodes_stay_where_the_map_has_them(tmp_path: Path) -> None:
    edges = ring_edges(tmp_path)
    for index, edge in ring_curves(edges).items():
        assert len(edge.node_ids) == len(edge.xy_m)
        own = [row for row, node in enumerate(edge.node_ids) if node]
        assert tuple(edge.node_ids[row] for row in own) == edges[index].node_ids
        assert (edge.xy_m[own] == edges[index].xy_m).all()


def test_a_ring_with_a_gap_keeps_its_chord_beside_it(tmp_path: Path) -> None:
    edges = ring_edges(tmp_path)
    whole = ring_curves(edges)
    gone = next(iter(whole))
    rest = ring_curves({index: edge for index, edge in edges.items() if index != gone})
    beside = next(i for i in rest if edges[i].start_node == edges[gone].end_node)
    assert set(rest) == set(whole) - {gone}
    assert rest[beside].length_m < whole[beside].length_m
    others = [i for i in rest if edges[i].start_node not in (edges[gone].end_node,)]
    assert any(rest[i].length_m == whole[i].length_m for i in others)


def test_a_ring_that_parts_goes_straight_to_where_it_does(tmp_path: Path) -> None:
    edges = ring_edges(tmp_path)
    whole = ring_curves(edges)
    last = next(edge for edge in whole.values() if edge.end_node == 5)
    onward = next(edges[i] for i, edge in whole.items() if edge.start_node == 5)
    other = msgspec.structs.replace(onward, index=99, end_node=77)
    parted = ring_curves({**edges, 99: other})
    assert parted[last.index].length_m < whole[last.index].length_m


def test_cars_go_round_in_a_circle_in_a_world(tmp_path: Path) -> None:
    world = world_of(roundabout().read(tmp_path))
    ring = [lane.centerline for lane in world.lanes if lane.role == "ring"]
    points = np.concatenate(ring)
    fit = np.linalg.lstsq(
        np.column_stack([2.0 * points, np.ones(len(points))]), (points**2).sum(axis=1), rcond=None
    )[0]
    assert np.hypot(*(points - fit[:2]).T) == pytest.approx(RADIUS_M, abs=0.05)
