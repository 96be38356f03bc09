"""From a start to a goal given as poses: over the roads, first as planned; or one line why not."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from foretwin.contracts.drive import RoutePose
from foretwin.contracts.frames import GeoPoint, geo_from_local
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.route import Route, RouteError
from foretwin.orchestrator.routing.route_to_goal import WayFinder, away_m
from foretwin.world_gen.roads.road_graph import RoadGraph
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions, TurnRule
from tests.orchestrator.grid_map import BLOCK_M, FRAME, graph_of, grid, node, road

COVERS = ("foretwin.orchestrator.routing.shortest_paths",)

EAST, NORTH, WEST = 0.0, math.pi / 2.0, math.pi
TOWN = grid(4, 3)


def pose(x_m: float, y_m: float, yaw_rad: float) -> RoutePose:
    lat, lon = geo_from_local(FRAME, np.array([x_m, y_m])).tolist()
    return RoutePose(GeoPoint(lat, lon), yaw_rad)


def degrees(*points_m: tuple[float, float]) -> np.ndarray:
    return geo_from_local(FRAME, np.asarray(points_m, dtype=np.float64))


def finder(graph: RoadGraph = TOWN, *rules: TurnRule) -> WayFinder:
    """Rules are of the node one block to the east."""
    return WayFinder(RoadIndex(graph), TurnRestrictions({node(1, 0): rules}, ()))


def turns_back(route: Route) -> bool:
    return any(one.edge.index == other.edge.index for one, other in pairwise(route.edges))


def names(route: Route) -> list[str]:
    return [one.edge.name for one in route.edges]


def test_the_way_leads_from_start_to_goal_and_is_the_shortest() -> None:
    found = finder().find(pose(20.0, 2.0, EAST), pose(298.0, 150.0, NORTH), planned_deg=None)
    assert found.planned_m == 0.0
    assert found.route.end_m == pytest.approx(5 * BLOCK_M)
    assert found.route.edges[0].key == (0, False)
    assert found.route.edges[-1].edge.name == "Column 3"
    assert away_m(found.route, np.array([298.0, 150.0])) == pytest.approx(2.0)


def test_the_plan_decides_where_it_leads_away_from_the_shortest_way() -> None:
    # The car turns north at once, where going straight on first would be as short.
    plan = degrees((20.0, 0.0), (100.0, 0.0), (100.0, 90.0))
    found = finder().find(pose(20.0, 0.0, EAST), pose(300.0, 150.0, NORTH), planned_deg=plan)
    assert names(found.route)[:2] == ["Row 0", "Column 1"]
    assert found.planned_m == pytest.approx(2 * BLOCK_M)
    assert found.route.edges[-1].edge.name == "Column 3"


def test_a_goal_that_the_plan_reaches_ends_the_route() -> None:
    plan = degrees((20.0, 0.0), (100.0, 0.0), (300.0, 0.0))
    found = finder().find(pose(20.0, 0.0, EAST), pose(150.0, 0.0, EAST), planned_deg=plan)
    assert [one.key for one in found.route.edges] == [(0, False), (1, False)]


def test_a_plan_that_follows_no_road_is_passed_over() -> None:
    plan = degrees((5000.0, 5000.0), (5100.0, 5000.0))
    found = finder().find(pose(20.0, 0.0, EAST), pose(80.0, 0.0, EAST), planned_deg=plan)
    assert [one.key for one in found.route.edges] == [(0, False)]
    assert found.planned_m == 0.0


def test_a_goal_behind_on_the_same_road_is_come_to_by_driving_round() -> None:
    found = finder().find(pose(80.0, 0.0, EAST), pose(20.0, 0.0, EAST), planned_deg=None)
    assert found.route.edges[0].key == found.route.edges[-1].key == (0, False)
    assert len(found.route.edges) > 2


def test_a_goal_that_lies_the_other_way_is_come_to_round_the_block_not_by_turning_back() -> None:
    found = finder().find(pose(20.0, 0.0, EAST), pose(150.0, 2.0, WEST), planned_deg=None)
    assert names(found.route) == ["Row 0", "Column 1", "Row 1", "Column 2", "Row 0"]


def test_who_can_only_turn_back_does_so() -> None:
    street = [
        road(0, 1, 2, [(0.0, 0.0), (100.0, 0.0)]),
        road(1, 2, 3, [(100.0, 0.0), (200.0, 0.0)]),
    ]
    found = finder(graph_of(street)).find(
        pose(20.0, 0.0, EAST), pose(20.0, 2.0, WEST), planned_deg=None
    )
    assert [one.key for one in found.route.edges] == [(0, False), (0, True)]


def test_the_way_keeps_to_turn_restrictions() -> None:
    goal = pose(100.0, 50.0, NORTH)
    free = finder().find(pose(20.0, 0.0, EAST), goal, planned_deg=None).route
    first, left = free.edges
    no_left = TurnRule(1, first.edge.way_id, (), frozenset({left.edge.way_id}), False, False)
    kept = finder(TOWN, no_left).find(pose(20.0, 0.0, EAST), goal, planned_deg=None).route
    assert kept.edges[-1].key == left.key
    assert kept.edges[-2].edge.name == "Row 0"
    assert kept.edges[-2].reverse
    assert not turns_back(kept)


def test_a_goal_behind_the_car_on_the_plans_first_road_is_not_there_yet() -> None:
    plan = degrees((60.0, 0.0), (100.0, 0.0), (200.0, 0.0))
    found = finder().find(pose(60.0, 0.0, EAST), pose(20.0, 0.0, EAST), planned_deg=plan)
    assert [one.key for one in found.route.edges[:2]] == [(0, False), (1, False)]
    assert found.route.edges[-1].key == (0, False)
    assert not turns_back(found.route)


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (pose(50.0, 50.0, EAST), "its goal 52.50045, 13.40074 lies within 30 m of no road"),
        (pose(150.0, 2.0, NORTH), "lies on no road that leads its way"),
    ],
)
def test_a_goal_on_no_road_is_told_in_one_line(goal: RoutePose, said: str) -> None:
    with pytest.raises(RouteError) as refused:
        finder().find(pose(20.0, 0.0, EAST), goal, planned_deg=None)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_goal_against_a_one_way_street_or_on_an_island_is_told() -> None:
    street = road(0, node(0, 0), node(1, 0), [(0.0, 0.0), (100.0, 0.0)], backward=False)
    island = road(1, node(0, 9), node(1, 9), [(0.0, 900.0), (100.0, 900.0)])
    graph = graph_of([street, island])
    start = pose(10.0, 0.0, EAST)
    with pytest.raises(RouteError, match="on no road that leads its way"):
        finder(graph).find(start, pose(50.0, 0.0, WEST), planned_deg=None)
    with pytest.raises(RouteError, match=r"no road leads from .* to its goal"):
        finder(graph).find(start, pose(50.0, 900.0, EAST), planned_deg=None)
