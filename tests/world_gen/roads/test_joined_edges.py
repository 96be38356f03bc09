"""Short stretches of road are one with what they go on in, wherever a mapper parted them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.world_gen.lanes.cross_section import cross_section
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.joined_edges import UNREAD
from foretwin.world_gen.roads.road_tags import (
    directions,
    is_car_road,
    lane_counts,
    open_to_cars,
    road_layer,
)
from foretwin.world_gen.roads.speed_limits import speed_limit
from foretwin.world_gen.roads.turn_restrictions import read_turn_restrictions
from tests.data.junctions.draw import draw_all
from tests.world_gen.data_maps import MAPS
from tests.world_gen.sketch import Sketch

AT_M = (0.0, 7.0, 20.0, 60.0, 200.0)
"""Places of the nodes 1, 2, ... of a road to the east; node 1 is a crossing's."""


def crossing(*parts: tuple[int, list[int], dict[str, str]]) -> Sketch:
    sketch = Sketch()
    for node, x_m in enumerate(AT_M, start=1):
        sketch.node(node, x_m, 0.0)
    sketch.node(10, 0.0, 150.0)
    sketch.node(11, 0.0, -150.0)
    sketch.road(90, [10, 1], "North")
    sketch.road(91, [1, 11], "South")
    for way, nodes, tags in parts:
        sketch.road(way, nodes, **{"name": "East", **tags})
    return sketch


def ways_of(sketch: Sketch, folder: Path) -> list[tuple[int, ...]]:
    return [edge.ways for edge in sketch.graph(folder).edges if edge.way_id < 90]


def test_a_short_piece_is_of_the_way_of_the_longest(tmp_path: Path) -> None:
    sketch = crossing((20, [1, 2], {}), (19, [2, 3], {"surface": "sett"}), (30, [3, 4, 5], {}))
    (edge,) = [edge for edge in sketch.graph(tmp_path).edges if edge.way_id < 90]
    assert (edge.way_id, edge.ways, edge.node_ids) == (30, (20, 19, 30), (1, 2, 3, 4, 5))
    assert edge.length_m == pytest.approx(200.0, abs=0.01)
    assert edge.xy_m[:, 0] - edge.xy_m[0, 0] == pytest.approx(AT_M, abs=0.01)


@pytest.mark.parametrize(
    "tags",
    [
        {"lanes": "3"},
        {"maxspeed": "30"},
        {"name": "Far East"},
        {"ref": "B 1"},
        {"bridge": "yes"},
        {"sidewalk": "left"},
        {"highway": "service"},
    ],
)
def test_what_is_driven_or_called_otherwise_stays_parted(
    tags: dict[str, str], tmp_path: Path
) -> None:
    sketch = crossing((20, [1, 2, 3], {}), (21, [3, 4, 5], tags))
    assert ways_of(sketch, tmp_path) == [(20,), (21,)]


def test_long_pieces_stay_parted(tmp_path: Path) -> None:
    sketch = crossing((20, [1, 2, 3, 4], {}), (21, [4, 5], {}))
    assert ways_of(sketch, tmp_path) == [(20,), (21,)]


def test_ways_drawn_toward_each_other_stay_parted(tmp_path: Path) -> None:
    sketch = crossing((20, [1, 2, 3], {}), (21, [5, 4, 3], {}))
    assert ways_of(sketch, tmp_path) == [(20,), (21,)]


def test_a_side_road_parts_them(tmp_path: Path) -> None:
    sketch = crossing((20, [1, 2, 3], {}), (21, [3, 4, 5], {}))
    sketch.road(22, [3, 10], "Side")
    assert ways_of(sketch, tmp_path) == [(20,), (21,), (22,)]


def test_a_mini_roundabout_is_a_junction_where_its_road_goes_on(tmp_path: Path) -> None:
    sketch = crossing((20, [1, 2, 6], {}), (21, [6, 4, 5], {}))
    sketch.node(6, 30.0, 0.0, highway="mini_roundabout")
    assert ways_of(sketch, tmp_path) == [(20,), (21,)]


def test_a_loop_stays_parted_at_its_middle(tmp_path: Path) -> None:
    sketch = crossing((20, [1, 2], {}), (21, [2, 3, 4], {}), (22, [4, 12], {}), (23, [12, 1], {}))
    sketch.node(12, 30.0, 30.0)
    assert ways_of(sketch, tmp_path) == [(20, 21), (22, 23)]


def test_a_way_that_ends_where_it_begins_is_one(tmp_path: Path) -> None:
    sketch = crossing((20, [6, 7, 1, 8, 6], {"junction": "roundabout", "name": "Ring"}))
    for node, x_m, y_m in ((6, 20.0, 0.0), (7, 10.0, 10.0), (8, 10.0, -10.0)):
        sketch.node(node, x_m, y_m)
    sketch.road(92, [8, 11], "Side")
    ring = [edge for edge in sketch.graph(tmp_path).edges if edge.way_id == 20]
    assert [(edge.ways, edge.node_ids) for edge in ring] == [((20,), (1, 8)), ((20,), (8, 6, 7, 1))]


def test_a_restriction_names_the_way_that_reaches_its_node(tmp_path: Path) -> None:
    sketch = crossing((20, [5, 4, 3], {}), (21, [3, 2, 1], {}))
    sketch.relations.append(
        '<relation id="1"><member type="way" ref="21" role="from"/>'
        '<member type="node" ref="1" role="via"/><member type="way" ref="90" role="to"/>'
        '<tag k="type" v="restriction"/><tag k="restriction" v="no_right_turn"/></relation>'
    )
    osm = sketch.read(tmp_path)
    graph = build_road_graph(osm)
    rules = read_turn_restrictions(osm, graph)
    (coming,) = [out.back for out in graph.at_node(1) if out.edge.way_id == 20]
    assert coming.ways == (20, 21)
    allowed = {out.ways for out in graph.at_node(1) if rules.step_allowed(coming, out)}
    assert allowed == {(21, 20), (91,)}
    north = next(out for out in graph.at_node(1) if out.edge.way_id == 90)
    assert rules.step_allowed(north.back, coming.back)


def test_a_restriction_over_ways_holds_where_they_are_joined(tmp_path: Path) -> None:
    sketch = crossing((20, [1, 2], {}), (21, [2, 3], {}))
    sketch.road(22, [3, 10], "Far")
    sketch.relation(
        1, {91: "from", 20: "via", 21: "via", 22: "to"}, type="restriction", restriction="no_u_turn"
    )
    osm = sketch.read(tmp_path)
    graph = build_road_graph(osm)
    by_way = {edge.way_id: edge for edge in graph.edges}
    assert by_way[21].ways == (20, 21)
    south, link, far = (
        next(out for out in graph.at_node(node) if out.edge.way_id == way)
        for node, way in ((11, 91), (1, 21), (3, 22))
    )
    assert not read_turn_restrictions(osm, graph).path_allowed([south, link, far])


@given(cuts=st.sets(st.sampled_from([2, 3])), ids=st.permutations([20, 21, 22]))
def test_pieces_near_a_crossing_are_the_same_road(
    cuts: set[int], ids: list[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    ends = [1, *sorted(cuts), 5]
    parts = [
        (way, list(range(a, b + 1)), {}) for way, a, b in zip(ids, ends, ends[1:], strict=False)
    ]
    path = tmp_path_factory.mktemp("map") / "map.osm"
    path.write_text(crossing(*parts).xml())
    edges = [edge for edge in build_road_graph(read_map(path)).edges if edge.way_id < 90]
    assert [edge.node_ids for edge in edges] == [(1, 2, 3, 4, 5)]
    assert edges[0].ways == tuple(way for way, *_ in parts)


class Asked(dict[str, str]):
    """Tags that remember which keys somebody looked for."""

    def __init__(self, tags: Mapping[str, str], keys: set[str]) -> None:
        super().__init__(tags)
        self.keys_asked = keys

    def get(self, key: str, default: Any = None) -> Any:
        self.keys_asked.add(key)
        return super().get(key, default)

    def __getitem__(self, key: str) -> str:
        self.keys_asked.add(key)
        return super().__getitem__(key)

    def __contains__(self, key: object) -> bool:
        self.keys_asked.add(str(key))
        return super().__contains__(key)


def test_nobody_who_tells_how_a_road_is_driven_looks_at_what_is_left_out(tmp_path: Path) -> None:
    draw_all(tmp_path)
    asked: set[str] = set()
    for path in sorted(tmp_path.glob("*.osm")):
        for edge in build_road_graph(read_map(path)).edges:
            tags = Asked(edge.tags, asked)
            lane_counts(tags, directions(tags))
            assert is_car_road(tags) == edge.car or not open_to_cars(tags)
            road_layer(tags)
            for country in ("DE", "GB", "US", ""):
                speed_limit(tags, country)
                speed_limit(Asked({"highway": edge.road_class}, asked), country)
            if edge.car:
                cross_section(msgspec.structs.replace(edge, tags=tags), centre_reverse=False)
    assert {"lit", "source:maxspeed", "lanes", "oneway"} <= asked
    assert {key for key in asked if key.startswith(UNREAD)} <= {"name"}


@pytest.mark.parametrize(
    ("tags", "kmph"),
    [
        ({}, (100.0, 100.0)),
        ({"source:maxspeed": "DE:urban"}, (50.0, 50.0)),
        ({"lit": "yes"}, (50.0, 50.0)),
        ({"maxspeed": "70", "maxspeed:backward": "30"}, (70.0, 30.0)),
    ],
)
def test_a_road_has_the_limits_of_all_of_its_tags(
    tags: dict[str, str], kmph: tuple[float, float], tmp_path: Path
) -> None:
    sketch = crossing((20, [1, 2, 3, 4, 5], {"highway": "secondary", "name": "", **tags}))
    (edge,) = [edge for edge in sketch.graph(tmp_path).edges if edge.way_id == 20]
    limits_mps = edge.limit_forward_mps.value, edge.limit_backward_mps.value
    assert [limit * 3.6 for limit in limits_mps] == pytest.approx(kmph)


@pytest.mark.real_data
@pytest.mark.parametrize("name", ["leeds", "liechtenstein"])
def test_real_roads_have_the_limits_of_all_of_their_tags(name: str, data_dir: Path) -> None:
    for edge in build_road_graph(read_map(data_dir / MAPS[name])).edges:
        assert edge.limit_forward_mps == speed_limit(edge.tags, edge.country)
        assert edge.limit_backward_mps == speed_limit(edge.tags, edge.country, reverse=True)
