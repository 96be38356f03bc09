"""Which junctions a route drives through, each once per passage."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import junctions_on_route
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadGraph
from tests.world_gen.sketch import Sketch


def route(graph: RoadGraph, nodes: list[int]) -> list[DirectedEdge]:
    """Return the edges from node to node."""
    return [
        next(item for item in graph.at_node(a) if item.end_node == b) for a, b in pairwise(nodes)
    ]


def two_crossings() -> Sketch:
    """A dual carriageway crosses a street; farther north a T-junction closes a block."""
    sketch = Sketch()
    for node, x_m, y_m in (
        (11, -150, -7),
        (12, 0, -7),
        (13, 150, -7),
        (21, 150, 7),
        (22, 0, 7),
        (23, -150, 7),
        (30, 0, 200),
        (31, 0, -150),
        (32, 100, 200),
        (33, -100, 200),
        (40, -75, 7),
        (41, -75, 90),
    ):
        sketch.node(node, x_m, y_m)
    sketch.road(110, [11, 12, 13], "Allee", oneway="yes")
    sketch.road(120, [21, 22, 40, 23], "Allee", oneway="yes")
    sketch.road(130, [30, 22, 12, 31], "Gasse")
    sketch.road(140, [33, 30, 32], "Ring")
    sketch.road(150, [40, 41], "Hof")
    return sketch


def passed(folder: Path, nodes: list[int]) -> list[tuple[str, int]]:
    osm = two_crossings().read(folder)
    graph = build_road_graph(osm)
    passages = junctions_on_route(find_intersections(osm, graph), route(graph, nodes))
    return [(item.junction.summary.id, item.edge_index) for item in passages]


def test_a_junction_of_two_nodes_is_passed_once(tmp_path: Path) -> None:
    assert passed(tmp_path, [31, 12, 22, 30, 32]) == [("n12", 0), ("n30", 2)]


def test_each_passage_counts(tmp_path: Path) -> None:
    assert passed(tmp_path, [31, 12, 22, 30, 22, 12, 13]) == [("n12", 0), ("n30", 2), ("n12", 3)]


def test_the_other_carriageway_passes_a_side_street_by(tmp_path: Path) -> None:
    assert passed(tmp_path, [21, 22, 40, 23]) == [("n12", 0), ("n40", 1)]
    assert passed(tmp_path, [11, 12, 13]) == [("n12", 0)]


def test_a_route_may_end_in_a_junction_but_a_start_in_one_is_no_passage(tmp_path: Path) -> None:
    assert passed(tmp_path, [33, 30]) == [("n30", 0)]
    assert passed(tmp_path, [30, 32]) == []
    assert passed(tmp_path, [22, 12, 31]) == []


def test_no_route_no_junction(tmp_path: Path) -> None:
    assert passed(tmp_path, [31]) == []
