"""Ways become edges, cut where roads meet."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.world_gen.osm.osm_map import MapError
from foretwin.world_gen.roads.build_graph import build_road_graph
from tests.world_gen.sketch import MANCHESTER, Sketch

COVERS = ("foretwin.world_gen.roads.road_graph",)


@pytest.fixture
def crossing() -> Sketch:
    sketch = Sketch()
    for node, x_m, y_m in (
        (1, -100, 0),
        (2, 0, 0),
        (3, 100, 0),
        (4, 0, 80),
        (5, 0, -80),
        (6, 50, 0),
    ):
        sketch.node(node, x_m, y_m)
    sketch.road(10, [1, 2, 6, 3], "Ost", oneway="yes")
    sketch.road(11, [4, 2, 5], "Nord", highway="tertiary")
    return sketch


def test_ways_are_cut_where_they_meet_alone(crossing: Sketch, tmp_path: Path) -> None:
    graph = crossing.graph(tmp_path)
    assert [edge.node_ids for edge in graph.edges] == [(1, 2), (2, 6, 3), (4, 2), (2, 5)]
    assert [edge.length_m for edge in graph.edges] == pytest.approx([100, 100, 80, 80], abs=0.01)
    assert [edge.index for edge in graph.edges] == [0, 1, 2, 3]


def test_all_leave_from_a_node_allowed_or_not(crossing: Sketch, tmp_path: Path) -> None:
    leaving = crossing.graph(tmp_path).at_node(2)
    assert [(item.edge.name, item.end_node, item.allowed) for item in leaving] == [
        ("Ost", 1, False),
        ("Ost", 3, True),
        ("Nord", 4, True),
        ("Nord", 5, True),
    ]


def test_ways_that_a_car_might_use_are_kept_but_no_car_roads(tmp_path: Path) -> None:
    sketch = Sketch()
    for node in range(1, 9):
        sketch.node(node, 10.0 * node, 0.0)
    for way, highway in enumerate(("residential", "pedestrian", "service", "track"), start=10):
        sketch.way(way, [way - 9, way - 8], highway=highway)
    sketch.way(20, [5, 6], highway="footway")
    sketch.way(21, [6, 7], highway="residential", access="private")
    sketch.way(22, [7, 8], highway="pedestrian", area="yes")
    edges = {edge.way_id: edge for edge in sketch.graph(tmp_path).edges}
    assert {way: edge.car for way, edge in edges.items()} == {
        10: True,
        11: False,
        12: False,
        13: False,
        21: False,
    }
    assert edges[12].forward
    assert not edges[11].forward
    assert not edges[21].backward


def test_a_closed_way_is_cut_at_its_ends_and_where_it_meets_itself(tmp_path: Path) -> None:
    sketch = Sketch()
    for node, x_m, y_m in ((1, 0, 0), (2, 50, 0), (3, 50, 50), (4, 0, 50), (5, -50, 0)):
        sketch.node(node, x_m, y_m)
    sketch.road(10, [5, 1, 2, 3, 3, 4, 1])
    edges = sketch.graph(tmp_path).edges
    assert [edge.node_ids for edge in edges] == [(5, 1), (1, 2, 3, 4, 1)]


def test_driving_side_comes_from_the_place_unless_tagged(tmp_path: Path) -> None:
    for place, tags, side in (
        (MANCHESTER, {}, "left"),
        (MANCHESTER, {"driving_side": "right"}, "right"),
    ):
        sketch = Sketch(place)
        sketch.node(1, 0.0, 0.0)
        sketch.node(2, 50.0, 0.0)
        sketch.road(10, [1, 2], **tags)
        assert sketch.graph(tmp_path).driving_side == side


def test_a_map_of_footpaths_is_refused(tmp_path: Path) -> None:
    sketch = Sketch()
    sketch.node(1, 0.0, 0.0)
    sketch.node(2, 50.0, 0.0)
    sketch.way(10, [1, 2], highway="footway")
    osm = sketch.read(tmp_path)
    with pytest.raises(MapError, match="holds no roads for cars"):
        build_road_graph(osm)


@settings(max_examples=25, deadline=None)
@given(paths=st.lists(st.lists(st.integers(1, 12), min_size=2, max_size=6), min_size=1, max_size=5))
def test_edges_join_to_the_ways_they_were_cut_from(
    paths: list[list[int]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    sketch = Sketch()
    for node in range(1, 13):
        sketch.node(node, 37.0 * (node % 5), 23.0 * node)
    for way, nodes in enumerate(paths, start=100):
        sketch.road(way, nodes, f"Way {way}")
    sketch.road(99, [1, 12])
    graph = sketch.graph(tmp_path_factory.mktemp("sketch"))
    for way, nodes in enumerate(paths, start=100):
        clean = [n for i, n in enumerate(nodes) if i == 0 or n != nodes[i - 1]]
        edges = [edge for edge in graph.edges if edge.way_id == way]
        joined = [edges[0].node_ids[0]] if edges else clean[:1]
        for edge in edges:
            assert edge.node_ids[0] == joined[-1]
            assert edge.xy_m.shape == (len(edge.node_ids), 2)
            joined += edge.node_ids[1:]
        assert joined == clean
    ends = {node for edge in graph.edges for node in (edge.start_node, edge.end_node)}
    for edge in graph.edges:
        assert not ends & set(edge.node_ids[1:-1])
