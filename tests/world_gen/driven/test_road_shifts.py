"""Shifts of roads from what was seen of them: true where driven, smooth, and joined at nodes."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.geometry.polyline import arc_lengths
from foretwin.world_gen.driven.road_shifts import Seen, moved_roads
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import RoadEdge
from tests.world_gen.drawn_maps import drawn_map

NODES = {1: (-200.0, 0.0), 2: (0.0, 0.0), 3: (200.0, 0.0), 4: (0.0, 150.0)}
STREET = {"highway": "residential"}
LEFT = np.array([0.0, 1.0])


def roads() -> dict[int, RoadEdge]:
    graph = build_road_graph(drawn_map(NODES, [(1, [1, 2, 3], STREET), (2, [2, 4], STREET)]))
    return {edge.index: edge for edge in graph.edges}


def along_main(edges: dict[int, RoadEdge], away_m: float) -> list[Seen]:
    main = [edge for edge in edges.values() if edge.way_id == 1]
    return [
        Seen(edge.index, float(at), LEFT, away_m)
        for edge in main
        for at in np.arange(1.0, edge.length_m, 2.0)
    ]


@settings(max_examples=25)
@given(st.floats(-2.0, 2.0).filter(lambda value: abs(value) > 0.05))
def test_roads_move_by_what_was_seen_and_stay_joined(away_m: float) -> None:
    edges = roads()

    moved = moved_roads(edges, along_main(edges, away_m)).roads

    ends: dict[int, list[np.ndarray]] = {}
    for index, edge in {**edges, **moved}.items():
        ends.setdefault(edge.start_node, []).append(edge.xy_m[0])
        ends.setdefault(edge.end_node, []).append(edge.xy_m[-1])
        if edge.way_id == 1:
            shift = edge.xy_m[:, 1] - edges[index].xy_m[0, 1]
            assert np.abs(shift - away_m).max() < 0.1 * abs(away_m)
            assert len(edge.node_ids) == len(edge.xy_m)
    for places in ends.values():
        assert np.ptp(places, axis=0).max() < 0.02


def test_what_was_not_seen_stays() -> None:
    edges = roads()

    assert moved_roads(edges, []) == ({}, {})
    moved = moved_roads(edges, [Seen(s.edge, s.at_m, LEFT, 0.001) for s in along_main(edges, 0.0)])
    assert moved.roads == {}


def test_a_line_bends_no_faster_than_a_road_does() -> None:
    edges = roads()
    seen = [s._replace(away_m=0.5 * (s.at_m > 100.0)) for s in along_main(edges, 0.0)]

    moved = moved_roads(edges, seen).roads

    for edge in moved.values():
        step = np.diff(edge.xy_m, axis=0)
        turned = np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))
        curvature = np.abs(turned) / np.diff(arc_lengths(edge.xy_m))[1:]
        assert curvature.max() < 1.0 / 150.0
