"""Driveways and parking aisles make junctions where a route uses them, or by choice."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.world_gen.truth_sheet import FOLDER
from world_gen.build import build_world
from world_gen.build_graph import build_road_graph
from world_gen.find_intersections import find_intersections
from world_gen.osm_map import OsmMap
from world_gen.read_osm import read_map
from world_gen.road_graph import RoadGraph
from world_gen.service_roads import with_roads, with_service_roads

MAP = FOLDER / "36_service_roads.osm"


@pytest.fixture(scope="module")
def drawn() -> tuple[OsmMap, RoadGraph]:
    osm = read_map(Path(MAP))
    return osm, build_road_graph(osm)


def test_by_default_they_make_no_junction(drawn: tuple[OsmMap, RoadGraph]) -> None:
    osm, graph = drawn
    assert len(find_intersections(osm, graph)) == 1
    assert with_roads(graph, []) is graph


def test_by_choice_all_of_them_do_and_ids_stay(drawn: tuple[OsmMap, RoadGraph]) -> None:
    osm, graph = drawn
    before = {j.summary.id: j.summary for j in find_intersections(osm, graph)}
    after = {j.summary.id: j.summary for j in find_intersections(osm, with_service_roads(graph))}
    assert len(after) == 3
    assert before.items() <= after.items()
    assert {summary.kind for summary in after.values()} == {"t_junction"}


def test_one_that_a_route_uses_has_lanes_in_its_world(drawn: tuple[OsmMap, RoadGraph]) -> None:
    osm, graph = drawn
    driveway = next(e for e in graph.edges if e.tags.get("service") == "driveway")
    opened = with_roads(graph, [driveway.index])
    found = find_intersections(osm, opened)
    assert len(found) == 2
    junction = next(j for j in found if driveway.start_node in j.nodes)
    world = build_world(osm, opened, junction)
    assert len(world.junctions[0].arms) == 3
    assert driveway.way_id in {lane.osm_way for lane in world.lanes}
    turns = sorted(c.turn for c in world.connections if c.junction_id == junction.summary.id)
    assert turns == ["left", "left", "right", "right", "straight", "straight"]
