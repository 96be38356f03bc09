from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.frames import geo_from_local
from foretwin.orchestrator.routing.line_matching import match_line
from foretwin.orchestrator.routing.map_matching import MapMatcher, Match
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.route import RouteError
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import RoadGraph
from tests.orchestrator.grid_map import drive, graph_of, grid, headings, road
from tests.world_gen.drawn_maps import drawn_map

COVERS = (
    "foretwin.orchestrator.routing.line_matching",
    "foretwin.orchestrator.routing.road_hypotheses",
    "foretwin.orchestrator.routing.road_index",
)

TOWN = grid(4, 3)
INDEX = RoadIndex(TOWN)


def follow(
    graph: RoadGraph, xy: np.ndarray, *, index: RoadIndex | None = None
) -> list[Match | None]:
    matcher = MapMatcher(graph, index=index)
    return [
        matcher.update(point, yaw, True, 8.0) for point, yaw in zip(xy, headings(xy), strict=True)
    ]


def roads(matches: list[Match | None]) -> list[tuple[int, bool]]:
    keys = [match.directed_edge.key for match in matches if match]
    return [key for number, key in enumerate(keys) if number == 0 or key != keys[number - 1]]


def test_a_drive_round_a_corner_follows_the_roads_in_order() -> None:
    matches = follow(TOWN, drive([(10, 0), (200, 0), (200, 190)]), index=INDEX)

    assert roads(matches) == [(0, False), (1, False), (13, False), (14, False)]
    last = matches[-1]
    assert last is not None
    assert last.s_on_edge_m == pytest.approx(90.0, abs=0.1)
    assert last.confident


def test_the_lateral_distance_is_positive_on_the_left() -> None:
    eastward = follow(TOWN, drive([(10, 2), (90, 2)]), index=INDEX)[-1]
    westward = follow(TOWN, drive([(90, 2), (10, 2)]), index=INDEX)[-1]

    assert eastward is not None
    assert westward is not None
    assert eastward.lateral_m == pytest.approx(2.0)
    assert westward.lateral_m == pytest.approx(-2.0)
    assert westward.directed_edge.reverse


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), noise_m=st.floats(0.0, 2.5), offset_m=st.floats(-3.0, 3.0))
def test_noise_and_offset_do_not_change_the_roads(
    seed: int, noise_m: float, offset_m: float
) -> None:
    rng = np.random.default_rng(seed)
    truth = drive([(10, 100), (300, 100), (300, 10)], spacing_m=4.0)
    shaken = truth + rng.normal(0.0, noise_m / 2.5, truth.shape) + [0.0, offset_m]
    matcher = MapMatcher(TOWN, index=INDEX)
    matches = [
        matcher.update(point, yaw, True, 8.0)
        for point, yaw in zip(shaken, headings(truth), strict=True)
    ]

    driven = list(roads(matches))
    assert driven[0] == (3, False)
    assert driven[-1] == (15, True)
    assert {(4, False), (5, False)} <= set(driven)


def test_the_match_does_not_depend_on_later_positions() -> None:
    xy = drive([(10, 0), (100, 0), (100, 190)])

    assert [m and m[1:] for m in follow(TOWN, xy[:50])] == [
        m and m[1:] for m in follow(TOWN, xy)[:50]
    ]


def test_standing_still_without_heading_leaves_the_direction_open_until_the_car_moves() -> None:
    matcher = MapMatcher(TOWN, index=INDEX)
    for _ in range(20):
        standing = matcher.update(np.array([50.0, 1.0]), 0.0, False, 0.0)
        assert standing is not None
        assert not standing.direction_known
    moving = matcher.update(np.array([49.0, 1.0]), math.pi, True, 2.0)

    assert moving is not None
    assert moving.direction_known
    assert moving.directed_edge.key == (0, True)


def test_leaving_the_map_ends_the_match_and_returning_begins_it_again() -> None:
    away = drive([(10, 0), (10, -300), (200, -300), (200, 90)], spacing_m=5.0)
    matches = follow(TOWN, away, index=INDEX)

    on_map = [match is not None for match in matches]
    assert on_map[0]
    assert on_map[-1]
    far = away[:, 1] < -60.0
    assert not any(np.asarray(on_map)[far])


def test_one_wild_fix_and_a_nan_do_not_end_the_match() -> None:
    xy = drive([(10, 0), (290, 0)])
    xy[40] = (1000.0, 1000.0)
    xy[60] = (math.nan, 0.0)
    matcher = MapMatcher(TOWN, index=INDEX)
    matches = [matcher.update(point, 0.0, True, 8.0) for point in xy]

    assert None not in matches
    assert roads(matches)[-1] == (2, False)


def test_a_pedestrian_street_is_matched_all_the_same_and_reported() -> None:
    town = grid(4, 3, pedestrian=frozenset([1]))
    matcher = MapMatcher(town)
    xy = drive([(10, 0), (290, 0)])
    matches = [matcher.update(point, 0.0, True, 8.0) for point in xy]

    assert roads(matches) == [(0, False), (1, False), (2, False)]
    (stretch,) = matcher.off_road_stretches
    assert stretch.reason == "no_car_road"
    assert stretch.way_ids == (1001,)
    assert stretch.length_m == pytest.approx(100.0, abs=8.0)


def test_a_one_way_street_driven_the_wrong_way_is_reported() -> None:
    lonely = graph_of([road(0, 1, 2, [(0, 0), (300, 0)], backward=False)])
    matcher = MapMatcher(lonely)
    for point in drive([(250, 0), (50, 0)]):
        match = matcher.update(point, math.pi, True, 8.0)

    assert match is not None
    assert match.directed_edge.reverse
    assert [stretch.reason for stretch in matcher.off_road_stretches] == ["against_one_way"]


@pytest.mark.parametrize("apart_m", [8.0, 12.0], ids=["long in doubt", "a step or two"])
def test_a_turn_onto_the_other_carriageway_is_no_drive_against_the_first(apart_m: float) -> None:
    dual = graph_of(
        [
            road(0, 1, 2, [(0, 0), (400, 0)], backward=False),
            road(1, 3, 4, [(400, apart_m), (0, apart_m)], backward=False),
            road(2, 1, 5, [(0, 0), (-100, 0)], backward=False),
        ]
    )
    angle, radius_m = np.linspace(-math.pi / 2, math.pi / 2, 40), apart_m / 2.0
    turn = [200.0, radius_m] + radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
    xy = np.vstack([drive([(-90, 0), (200, 0)]), turn, drive([(200, apart_m), (50, apart_m)])])
    matcher, told, on = MapMatcher(dual), [], []
    for point, yaw in zip(xy, headings(xy), strict=True):
        on.append(matcher.update(point, yaw, True, 5.0))
        told.append([way for one in matcher.off_road_stretches for way in one.way_ids])

    assert (0, True) in roads(on)  # for a moment it seems to turn in the road
    assert roads(on)[-1] == (1, False)
    assert [ways for before, ways in pairwise(told) if ways != before] == [[1002]]


def test_a_few_metres_against_a_one_way_street_are_not_told() -> None:
    matcher = MapMatcher(graph_of([road(0, 1, 2, [(0, 0), (300, 0)], backward=False)]))
    for x, told in ((250.0, 0), (246.0, 0), (243.0, 1)):
        matcher.update(np.array([x, 0.0]), math.pi, True, 8.0)
        assert len(matcher.off_road_stretches) == told


def test_the_carriageway_that_runs_the_cars_way_wins_although_the_other_is_nearer() -> None:
    dual = graph_of(
        [
            road(0, 1, 2, [(0, 0), (400, 0)], backward=False),
            road(1, 3, 4, [(400, 8), (0, 8)], backward=False),
        ]
    )
    matches = follow(dual, drive([(10, 5), (390, 5)]))

    assert roads(matches) == [(0, False)]


def test_a_line_becomes_its_roads() -> None:
    xy = drive([(10, 3), (200, 3), (197, 190)], spacing_m=15.0)
    matched = match_line(TOWN, geo_from_local(TOWN.frame, xy), index=INDEX)

    (route,) = matched.routes
    assert [edge.key for edge in route.validate().edges] == [
        (0, False), (1, False), (13, False), (14, False),
    ]  # fmt: skip
    assert matched.near_road_share == 1.0


def test_a_missing_piece_of_map_is_bridged_by_the_shortest_way() -> None:
    # The line cuts through a block, far from every road for 60 m.
    town = grid(3, 2)
    xy = drive([(0, 0), (60, 0), (160, 100), (200, 100)], spacing_m=5.0)
    matched = match_line(town, geo_from_local(town.frame, xy))

    (route,) = matched.routes
    route.validate()
    assert route.edges[0].start_node == 1
    assert route.edges[-1].end_node == 103


def test_a_line_that_leaves_the_map_for_long_becomes_two_routes() -> None:
    xy = drive([(10, 0), (90, 0), (90, -900), (210, -900), (210, 0), (290, 0)], spacing_m=10.0)
    matched = match_line(TOWN, geo_from_local(TOWN.frame, xy), index=INDEX)

    assert len(matched.routes) == 2
    assert matched.near_road_share < 0.3


def test_a_drive_past_a_bollard_becomes_two_routes() -> None:
    nodes = {1: (0.0, 0.0), 2: (100.0, 0.0), 3: (200.0, 0.0)}
    street = [(5, (1, 2, 3), {"highway": "residential"})]
    for barrier, routes in (("bollard", 2), ("gate", 1)):
        graph = build_road_graph(drawn_map(nodes, street, node_tags={2: {"barrier": barrier}}))
        line = drive([(10, 0), (190, 0)], spacing_m=8.0) + graph.edges[0].xy_m[0]
        found = match_line(graph, geo_from_local(graph.frame, line)).routes
        assert len(found) == routes


def test_a_line_off_the_map_is_refused_in_one_line() -> None:
    with pytest.raises(RouteError, match=r"^tour.gpx is off the map: 0 % of its points lie within"):
        match_line(TOWN, np.array([[48.0, 9.0], [48.001, 9.001]]), name="tour.gpx", index=INDEX)


def test_a_line_of_one_point_is_refused() -> None:
    with pytest.raises(RouteError, match="1 usable points; at least 2"):
        match_line(TOWN, np.array([[52.5, 13.4], [math.nan, 13.4]]))


def test_a_wild_position_leaves_the_car_where_it_was_on_its_road() -> None:
    town = grid(5, 4)
    matcher = MapMatcher(town)
    before = None
    for x in range(20, 61, 2):
        before = matcher.update(np.array([float(x), 100.0]), 0.0, True, 8.0)
    wild = matcher.update(np.array([5000.0, 5000.0]), 0.0, True, 8.0)

    assert before is not None
    assert wild is not None
    assert wild.directed_edge == before.directed_edge
    assert wild.s_on_edge_m == pytest.approx(before.s_on_edge_m)
    assert not wild.confident
