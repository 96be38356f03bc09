from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import DrivingSide
from foretwin.geometry.steering import MAX_CURVATURE_PM
from foretwin.orchestrator.routing.driving_path import (
    FAR_TURN_RADIUS_M,
    KERB_TURN_RADIUS_M,
    PathGeometry,
    driving_path,
)
from foretwin.orchestrator.routing.edge_parts import part_of
from foretwin.orchestrator.routing.route import Route
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge, RoadGraph
from tests.orchestrator.grid_map import graph_of, grid, road

LANE_WIDTH_M = 3.0
"""Of a residential road without tags."""


def route_over(graph: RoadGraph) -> Route:
    return Route(tuple(DirectedEdge(edge, False) for edge in graph.edges))


def curvature(path: PathGeometry) -> np.ndarray:
    step = np.diff(path.xy_m, axis=0)
    return np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))


def whole(graph: RoadGraph, route: Route | None = None) -> PathGeometry:
    route = route or route_over(graph)
    return driving_path(route, s_from_m=0.0, s_to_m=route.end_m)


def straight(lanes: tuple[float, float], *, two_way: bool = True) -> RoadEdge:
    return road(0, 1, 2, [(0, 0), (300, 0)], lanes=lanes, backward=two_way)


@pytest.mark.parametrize(
    ("lanes", "two_way", "side", "offset_lanes"),
    [
        ((1, 1), True, "right", -0.5),
        ((1, 1), True, "left", 0.5),
        ((1, 0), False, "right", 0.0),
        ((2, 0), False, "right", -0.5),
        ((3, 0), False, "right", 0.0),
        ((2, 2), True, "right", -1.5),
        ((1, 2), True, "right", -1.0),
    ],
)
def test_on_a_straight_road_the_path_lies_in_its_lane(lanes, two_way, side, offset_lanes) -> None:  # type: ignore[no-untyped-def]
    path = whole(graph_of([straight(lanes, two_way=two_way)], driving_side=side))

    assert path.xy_m[:, 1] == pytest.approx(offset_lanes * LANE_WIDTH_M)


def test_points_are_a_metre_apart_and_begin_where_asked() -> None:
    graph = graph_of([straight((1, 1))])
    path = driving_path(route_over(graph), s_from_m=40.0, s_to_m=120.0)

    assert path.xy_m[0] == pytest.approx([40.0, -1.5])
    assert path.xy_m[-1] == pytest.approx([120.0, -1.5])
    assert np.hypot(*np.diff(path.xy_m, axis=0).T) == pytest.approx(1.0)
    assert path.s_m == pytest.approx(path.xy_m[:, 0])
    assert path.speed_limit_mps == pytest.approx(50 / 3.6)


@pytest.mark.parametrize(
    ("north", "radius_m"), [(150.0, FAR_TURN_RADIUS_M), (-150.0, KERB_TURN_RADIUS_M)]
)
def test_a_turn_at_a_junction_is_an_arc_of_the_lanes_radius(north: float, radius_m: float) -> None:
    corner = graph_of([road(0, 1, 2, [(0, 0), (150, 0)]), road(1, 2, 3, [(150, 0), (150, north)])])
    bend = curvature(whole(corner))

    assert bend.sum() == pytest.approx(math.copysign(math.pi / 2, north), abs=0.02)
    # Smoothing spreads the arc, so its middle is a little wider.
    assert 0.75 / radius_m < np.abs(bend).max() < 1.15 / radius_m


def test_the_corners_of_lanes_in_a_bend_are_driven_as_one() -> None:
    # A bend of 90 m, drawn with corners of 16 degrees.
    heading = np.radians(16.0) * np.arange(5)
    legs_m = np.array([100.0, 25.0, 25.0, 25.0, 100.0])[:, None]
    nodes = np.cumsum(legs_m * np.stack([np.cos(heading), np.sin(heading)], axis=-1), axis=0)
    line = shapely.LineString(np.concatenate([[[0.0, 0.0]], nodes]))
    route = route_over(graph_of([road(0, 1, 2, [*line.coords])]))

    def onto_lanes(xy_m: Array, _: Array) -> Array:
        along = shapely.line_locate_point(line, shapely.points(xy_m))
        return shapely.get_coordinates(shapely.line_interpolate_point(line, along))

    path = driving_path(route, s_from_m=40.0, s_to_m=240.0, onto_lanes=onto_lanes)
    assert np.abs(curvature(path)).max() < 2.5 / 90.0
    assert shapely.distance(line, shapely.points(path.xy_m)).max() < 1.0


def test_before_a_left_turn_the_path_moves_to_the_left_lane() -> None:
    corner = graph_of(
        [
            road(0, 1, 2, [(0, 0), (150, 0)], lanes=(2, 0), backward=False),
            road(1, 2, 3, [(150, 0), (150, 150)]),
        ]
    )

    assert whole(corner).xy_m[100, 1] == pytest.approx(LANE_WIDTH_M / 2, abs=0.2)


def test_a_jog_of_a_badly_drawn_junction_does_not_kink_the_path() -> None:
    jog = graph_of(
        [
            road(0, 1, 2, [(0, 0), (100, 0)]),
            road(1, 2, 3, [(100, 0), (104, 1.5)]),
            road(2, 3, 4, [(104, 1.5), (200, 1.5)]),
        ]
    )

    assert np.abs(curvature(whole(jog))).max() < 0.06


def test_a_side_road_just_before_a_turn_does_not_sharpen_it() -> None:
    plain = graph_of([road(0, 1, 2, [(0, 0), (150, 0)]), road(1, 2, 3, [(150, 0), (150, 150)])])
    joined = graph_of(
        [
            road(0, 1, 2, [(0, 0), (147, 0)]),
            road(1, 2, 3, [(147, 0), (150, 0)]),
            road(2, 3, 4, [(150, 0), (150, 150)]),
        ]
    )

    assert whole(joined).xy_m == pytest.approx(whole(plain).xy_m, abs=0.1)


def test_a_roundabout_is_followed_round() -> None:
    angles = np.linspace(-math.pi / 2, math.pi / 2, 13)
    ring = [(20.0 * math.cos(a) + 80.0, 20.0 * math.sin(a)) for a in angles]
    graph = graph_of(
        [
            road(0, 1, 2, [(80, -100), (80, -20)]),
            road(1, 2, 3, ring, lanes=(1, 0), backward=False),
            road(2, 3, 4, [(80, 20), (80, 100)]),
        ]
    )
    path = whole(graph)
    inside = np.abs(path.xy_m[:, 1]) < 10.0
    radius = np.hypot(path.xy_m[inside, 0] - 80.0, path.xy_m[inside, 1])

    assert np.abs(radius - 20.0).max() < 1.5
    assert np.abs(curvature(path)).max() < 0.25


def test_the_same_place_is_the_same_whatever_window_it_is_asked_in() -> None:
    town = grid(4, 3)
    edges = tuple(DirectedEdge(town.edges[index], False) for index in (0, 1, 13, 14))
    route = Route(edges)
    wide = driving_path(route, s_from_m=0.0, s_to_m=400.0)
    narrow = driving_path(route, s_from_m=150.0, s_to_m=260.0)
    again = np.stack([np.interp(narrow.s_m, wide.s_m, wide.xy_m[:, k]) for k in (0, 1)], axis=-1)

    assert np.abs(again - narrow.xy_m).max() < 0.1


@settings(max_examples=40, deadline=None)
@given(
    turns=st.lists(st.floats(-1.7, 1.7), min_size=1, max_size=5),
    legs=st.lists(st.floats(25.0, 120.0), min_size=6, max_size=6),
    lanes=st.integers(1, 3),
    side=st.sampled_from(["right", "left"]),
)
def test_any_sequence_of_turns_gives_a_steerable_evenly_spaced_path(
    turns, legs, lanes, side
) -> None:  # type: ignore[no-untyped-def]
    place, heading, edges = np.zeros(2), 0.0, []
    for number, turn in enumerate([0.0, *turns]):
        heading += turn
        end = place + legs[number] * np.array([math.cos(heading), math.sin(heading)])
        edges.append(
            road(number, number, number + 1, [tuple(place), tuple(end)], lanes=(lanes, lanes))
        )
        place = end
    graph = graph_of(edges, driving_side=side)
    path = whole(graph)

    assert np.isfinite(path.xy_m).all()
    assert np.abs(np.hypot(*np.diff(path.xy_m, axis=0).T) - 1.0).max() < 0.1
    assert (np.diff(path.s_m) > 0.0).all()
    assert np.abs(curvature(path)).max() < 0.25
    assert curvature(path).sum() == pytest.approx(sum(turns), abs=0.15)


@pytest.mark.parametrize("side", ["right", "left"])
def test_who_turns_back_in_the_road_does_so_there_and_across_it(side: DrivingSide) -> None:
    graph = graph_of([straight((1.0, 1.0))], driving_side=side)
    (edge,) = graph.edges
    there, back = DirectedEdge(edge, False), DirectedEdge(edge, True)
    end_m = edge.length_m
    turned_m = 0.6 * end_m
    parts = part_of(there, 0.0, turned_m), part_of(back, end_m - turned_m, end_m)
    path = whole(graph, Route(parts))
    farthest = int(path.xy_m[:, 0].argmax())

    assert path.xy_m[farthest, 0] == pytest.approx(edge.xy_m[0, 0] + turned_m, abs=2.0)
    assert path.s_m[farthest] == pytest.approx(turned_m, abs=2.0)
    assert (np.diff(path.s_m) >= 0.0).all()
    turn = curvature(path)[farthest - 3 : farthest + 4]
    assert (np.sign(turn) == (1.0 if side == "right" else -1.0)).all()
    assert np.abs(turn).max() < MAX_CURVATURE_PM


def test_a_stretch_off_the_route_is_refused() -> None:
    graph = graph_of([straight((1, 1))])

    with pytest.raises(ValueError, match=r"route runs from 0.0 m to 300.0 m"):
        driving_path(route_over(graph), s_from_m=400.0, s_to_m=500.0)
