"""What a viewer draws around the Worlds: the nearest roads, the route, names on the way."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.frames import GeoPoint, LocalFrame, target_from_source_m
from foretwin.orchestrator.routing import roads_shown as shown
from foretwin.orchestrator.routing.roads_shown import roads_shown
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.roads.road_graph import DirectedEdge
from tests.orchestrator.grid_map import FRAME, grid

COVERS = ("foretwin.contracts.roads_shown",)

HERE = LocalFrame(GeoPoint(FRAME.origin.lat_deg + 1e-3, FRAME.origin.lon_deg))


def test_all_roads_and_the_route_are_there_in_the_frame_of_the_drive() -> None:
    graph = grid(3, 3)
    edge = next(one for one in graph.edges if one.drivable)
    found = roads_shown(graph, [Route((DirectedEdge(edge, False),))], HERE)
    drivable = [one for one in graph.edges if one.drivable]
    assert found.counts.tolist() == [len(one.xy_m) for one in drivable]
    every = np.concatenate([one.xy_m for one in drivable])
    assert found.xy_m == pytest.approx(target_from_source_m(HERE, graph.frame, every))
    assert found.routes[0] == pytest.approx(target_from_source_m(HERE, graph.frame, edge.xy_m))
    assert edge.name in {one.name for one in found.names}
    assert len({one.name for one in found.names}) == len(found.names)


def test_of_too_many_roads_the_nearest_to_the_way_are_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = grid(3, 3)
    edge = next(one for one in graph.edges if one.drivable)
    monkeypatch.setattr(shown, "MOST_ROADS", 1)
    monkeypatch.setattr(shown, "MOST_NAMES", 1)
    found = roads_shown(graph, [Route((DirectedEdge(edge, False),))], HERE)
    assert found.xy_m == pytest.approx(found.routes[0])
    assert len(found.names) == 1


def test_without_a_route_no_street_is_named() -> None:
    found = roads_shown(grid(3, 3), [], HERE)
    assert (found.routes, found.names) == ((), ())
    assert len(found.counts) > 3
