"""Driveways near a junction leave its approaches, and what is known of them, as they are."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.world import World
from foretwin.geometry.world_heights import heights_of
from foretwin.orchestrator.routing.driving_path import driving_path
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.world_lanes import WorldLanes
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.map_index import index_map
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import DirectedEdge
from tests.world_gen.drawn_maps import GERMANY, STREET, Tags, crossing
from tests.world_gen.elevation.hills import raster

DRIVEWAY = {"highway": "service", "service": "driveway"}
AT_LIGHTS: dict[int, Tags] = {50: {"highway": "traffic_signals"}}


def beside(
    *at_m: float, kind: Tags | None = DRIVEWAY, lit: bool = False, parted: bool = False
) -> OsmMap:
    """Return the crossing with driveways off the street, at metres to the east of its middle.

    They are roads of another `kind`, or none. Lights stand 15 m to the east where it is `lit`.
    Where it is `parted`, another way begins at the last of them.
    """
    nodes = {20 + i: (x, 0.0) for i, x in enumerate(at_m)} | {50: (15.0, 0.0)}
    street = [0, *sorted(nodes, key=lambda node: nodes[node]), 1]
    gate = street.index(19 + len(at_m)) if parted else 0
    ways = [(11, street[gate:], STREET), *([(15, street[: gate + 1], STREET)] if parted else [])]
    return crossing(
        node_tags=AT_LIGHTS if lit else None,
        extra_nodes=nodes | {30 + i: (x, 30.0) for i, x in enumerate(at_m)},
        extra_ways=[
            *ways,
            *((40 + i, [20 + i, 30 + i], kind) for i in range(len(at_m)) if kind),
        ],
    )


def world_of(osm: OsmMap) -> World:
    graph = build_road_graph(osm)
    junctions = find_intersections(osm, graph)
    dem = raster(lambda x, y: 50.0 + 0.05 * x, GERMANY)
    index = index_map(osm, graph, junctions, dem=dem)
    middle = next(j for j in junctions if 0 in j.nodes)
    return build_world(osm, graph, middle, index=index)


def lanes_of(world: World) -> dict[str, list[list[float]]]:
    return {lane.id: lane.centerline.tolist() for lane in world.lanes}


@pytest.mark.parametrize(("lit", "parted"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("at_m", [(8.0,), (12.0,), (6.0, 13.0, 30.0)])
def test_lanes_lines_and_heights_are_those_without_the_driveways(
    at_m: tuple[float, ...], lit: bool, parted: bool
) -> None:
    with_them = world_of(beside(*at_m, lit=lit, parted=parted))
    without = world_of(beside(*at_m, kind=None, lit=lit, parted=parted))

    assert lanes_of(with_them) == lanes_of(without)
    assert [c.id for c in with_them.connections] == [c.id for c in without.connections]
    assert [line.ends.tolist() for line in with_them.stop_lines] == [
        line.ends.tolist() for line in without.stop_lines
    ]
    assert with_them.junctions[0].arms == without.junctions[0].arms
    heights, usual = heights_of(with_them), heights_of(without)
    assert heights is not None
    assert usual is not None
    line = np.column_stack([np.linspace(2.0, 95.0, 50), np.full(50, -1.5)])
    np.testing.assert_allclose(heights.surface_at(line), usual.surface_at(line), atol=0.2)


def test_a_driveway_that_shortens_nothing_parts_the_road_as_before() -> None:
    ids = {road.id for road in world_of(beside(40.0)).roads}
    assert {"w11.0.20", "w11.20.1"} <= ids


def test_a_road_for_cars_is_a_junction_of_its_own() -> None:
    ids = {road.id for road in world_of(beside(30.0, kind=STREET)).roads}
    assert "w11.20.1" in ids


@pytest.mark.parametrize(
    ("parted", "beyond"), [(False, False), (False, True), (True, True), (True, False)]
)
def test_a_route_follows_the_lane_that_goes_on_past_the_driveway(
    parted: bool, beyond: bool
) -> None:
    osm = beside(6.0, 13.0, 44.0, parted=parted)
    graph = build_road_graph(osm)
    edges = {(edge.start_node, edge.end_node): edge for edge in graph.edges}
    ways = [edges[3, 0], edges[0, 20], edges[20, 21], edges[21, 22], edges[22, 1]]
    route = Route(tuple(DirectedEdge(edge, False) for edge in ways[: None if beyond else -1]))
    path = driving_path(route, s_from_m=0.0, s_to_m=route.end_m)
    lanes = WorldLanes(world_of(osm), graph)

    found = {one.piece.id: one for one in lanes.beside(route, path.xy_m, path.s_m)}

    on = found["w13.3.0.f0>w11.0.1.f0"]
    assert found["w11.0.1.f0"].begin_m == pytest.approx(on.end_m, abs=1.0)
    assert found["w11.0.1.f0"].end_m == pytest.approx(route.end_m, abs=1.0)
