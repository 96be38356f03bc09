"""Borders of lanes and connections: what is shared is shared to the last bit, nothing crosses."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import World
from foretwin.world_gen.export.lane_borders import Borders, crossing, lane_borders
from tests.world_gen.drawn_maps import crossing as crossing_map
from tests.world_gen.drawn_maps import roundabout, world_of
from tests.world_gen.export.drawn_world import connection, leading_to, road, world
from tests.world_gen.path_shape import rounded, turn_curve

COVERS = ("foretwin.world_gen.export.parallels",)
WIDTHS = st.lists(st.floats(2.0, 5.0), min_size=1, max_size=4)
STRAIGHT = [(0.0, 0.0), (50.0, 0.0)]


@st.composite
def winding_lines(draw: st.DrawFn) -> Array:
    """Lines of a few segments that bend as streets do, with rounded corners."""
    headings = np.cumsum(draw(st.lists(st.floats(-0.9, 0.9), min_size=1, max_size=6)))
    steps = draw(st.lists(st.floats(12.0, 40.0), min_size=len(headings), max_size=len(headings)))
    moves = np.column_stack([np.cos(headings), np.sin(headings)]) * np.array(steps)[:, None]
    return rounded(np.concatenate([[[0.0, 0.0]], np.cumsum(moves, axis=0)]))


def assert_neighbours_share(drawn: World, borders: Mapping[str, Borders]) -> None:
    for lane in drawn.lanes:
        if lane.right_id is not None:
            assert np.array_equal(borders[lane.id].right, borders[lane.right_id].left)
        left, right = borders[lane.id]
        assert len(left) == len(right)
    for one in drawn.roads:
        against = [name for name in one.lane_ids if name.split(".")[-1].startswith("b")]
        ahead = [name for name in one.lane_ids if name not in against]
        if against and ahead:
            assert np.array_equal(borders[against[-1]].left, borders[ahead[0]].left[::-1])


def assert_successors_share(drawn: World, borders: Mapping[str, Borders]) -> None:
    lanes = {lane.id for lane in drawn.lanes}
    pairs = [(a.id, b) for a in drawn.lanes for b in a.successor_ids if b in lanes]
    pairs += [(c.from_lane_id, c.id) for c in drawn.connections]
    pairs += [(c.id, c.to_lane_id) for c in drawn.connections]
    for before, after in pairs:
        for side in (0, 1):
            assert np.array_equal(borders[before][side][-1], borders[after][side][0])


@given(line=winding_lines(), ahead=WIDTHS, against=st.one_of(st.just([]), WIDTHS))
def test_borders_of_a_road_are_shared_and_never_cross(
    line: Array, ahead: list[float], against: list[float]
) -> None:
    drawn = world(road("r", line, ahead=ahead, against=against))
    borders = lane_borders(drawn)
    assert_neighbours_share(drawn, borders)
    assert not any(crossing(borders.values()))
    lines = [borders[name].right for name in drawn.roads[0].lane_ids if ".f" in name]
    for inner, outer in pairwise(lines):
        assert not shapely.LineString(inner).intersects(shapely.LineString(outer))


def test_points_stay_side_by_side_before_and_after_a_tight_bend() -> None:
    """The inner border loses points in a bend of 1 m, and gets them back in it alone."""
    turned = np.linspace(-np.pi / 2, 0.0, 25)
    bend = np.column_stack([np.cos(turned), 1.0 + np.sin(turned)])
    before = np.array([[x, 0.0] for x in range(-60, 0, 10)])
    after = np.array([[1.0, y] for y in range(11, 62, 10)])
    line = np.concatenate([before, bend, after])
    inner = lane_borders(world(road("r", line, ahead=[3.0], against=[3.0])))["r.b0"]
    middle = (inner.left + inner.right)[::-1] / 2
    assert middle[:6] == pytest.approx(before + np.array([0.0, 1.5]), abs=0.002)
    assert middle[-6:] == pytest.approx(after - np.array([1.5, 0.0]), abs=0.002)


@given(line=winding_lines(), widths=WIDTHS)
def test_lanes_are_as_wide_as_they_say(line: Array, widths: list[float]) -> None:
    borders = lane_borders(world(road("r", line, ahead=widths)))
    for i, width in enumerate(widths):
        left, right = borders[f"r.f{i}"]
        assert np.hypot(*(left[0] - right[0])) == pytest.approx(width, abs=0.002)
        assert np.hypot(*(left[-1] - right[-1])) == pytest.approx(width, abs=0.002)
        gap = shapely.distance(shapely.points(right), shapely.LineString(left))
        assert gap.max() < 2.01 * width  # no mitre longer than that


@given(
    bend=st.floats(-0.6, 0.6),
    before=st.lists(st.floats(2.5, 4.0), min_size=2, max_size=2),
    after=st.lists(st.floats(2.5, 4.0), min_size=2, max_size=2),
    backward=st.booleans(),
)
def test_lanes_that_lead_straight_into_others_end_on_their_points(
    bend: float, before: list[float], after: list[float], backward: bool
) -> None:
    beyond = (50.0 + 40.0 * np.cos(bend), 40.0 * np.sin(bend))
    first, lanes = road("a", STRAIGHT, ahead=before)
    if backward:  # the second road's nodes run the other way
        second = road("b", [beyond, (50.0, 0.0)], ahead=[], against=after)
        names = {"a.f0": "b.b0", "a.f1": "b.b1"}
    else:
        second = road("b", [(50.0, 0.0), beyond], ahead=after)
        names = {"a.f0": "b.f0", "a.f1": "b.f1"}
    drawn = world((first, leading_to(lanes, names)), second)
    borders = lane_borders(drawn)
    assert_neighbours_share(drawn, borders)
    assert_successors_share(drawn, borders)
    assert not any(crossing(borders.values()))


@given(
    heading=st.floats(-2.2, 2.2),
    x_m=st.floats(12.0, 30.0),
    widths=st.tuples(st.floats(2.5, 4.5), st.floats(2.5, 4.5)),
)
def test_connections_take_up_every_change_of_width(
    heading: float, x_m: float, widths: tuple[float, float]
) -> None:
    away = np.array([np.cos(heading), np.sin(heading)])
    start = np.array([50.0, -widths[0] / 2])
    # A place ahead that one reaches by turning evenly.
    finish = start + x_m * np.array([np.cos(heading / 2), np.sin(heading / 2)])
    right = np.array([away[1], -away[0]])
    begin = finish - right * widths[1] / 2
    path = turn_curve(start, np.array([1.0, 0.0]), finish, away)
    drawn = world(
        road("a", STRAIGHT, ahead=[widths[0]]),
        road("b", [begin, begin + 40.0 * away], ahead=[widths[1]]),
        connections=[connection("a.f0", "b.f0", path)],
    )
    borders = lane_borders(drawn)
    assert_successors_share(drawn, borders)
    assert not any(crossing(borders.values()))
    left, right_border = borders["a.f0>b.f0"]
    assert len(left) == len(right_border) == len(path)
    across = np.hypot(*(left - right_border).T)
    assert across.min() > 0.9 * min(widths)


def test_a_sharp_corner_keeps_its_inner_borders_apart() -> None:
    line = [(0.0, 0.0), (30.0, 0.0), (30.0, -30.0)]  # turns right, to the lanes' side
    drawn = world(road("r", line, ahead=[3.0, 3.0, 3.0]))
    borders = lane_borders(drawn)
    assert not any(crossing(borders.values()))
    inner = shapely.LineString(borders["r.f2"].right)
    assert inner.distance(shapely.Point(21.0, -9.0)) < 0.01


def test_a_u_turn_on_one_road_turns_about_the_line_between_its_lanes() -> None:
    path = turn_curve(
        np.array([50.0, -1.5]), np.array([1.0, 0.0]), np.array([50.0, 1.5]), np.array([-1.0, 0.0])
    )
    turning = connection("a.f0", "a.b0", path, turn="u_turn")
    drawn = world(road("a", STRAIGHT, ahead=[3.0], against=[3.0]), connections=[turning])
    left, right = lane_borders(drawn)["a.f0>a.b0"]
    assert np.abs(left[:, 1]).max() < 0.01
    assert left[:, 0].min() >= 50.0
    assert np.hypot(*(right - left).T).max() < 3.6
    assert len(left) == len(right)


def test_repeated_points_of_a_road_do_no_harm() -> None:
    line = [(0.0, 0.0), (0.0, 0.0), (0.0, 0.001), (40.0, 0.0), (40.0, 0.0)]
    borders = lane_borders(world(road("r", line, ahead=[3.0])))["r.f0"]
    assert borders.left[[0, -1]].tolist() == [[0.0, 0.0], [40.0, 0.0]]
    assert borders.right[[0, -1]].tolist() == [[0.0, -3.0], [40.0, -3.0]]


def test_roads_and_connections_without_length_do_no_harm() -> None:
    spot = np.zeros((2, 2))
    drawn = world(
        road("r", spot, ahead=[3.0]),
        road("s", STRAIGHT, ahead=[3.0]),
        connections=[connection("r.f0", "s.f0", spot)],
    )
    borders = lane_borders(drawn)
    assert_successors_share(drawn, borders)
    assert all(np.isfinite(line).all() for pair in borders.values() for line in pair)


@pytest.mark.parametrize("drawn", [world_of(crossing_map()), world_of(roundabout())])
def test_borders_of_a_junction_are_shared(drawn: World) -> None:
    borders = lane_borders(drawn)
    assert set(borders) == {p.id for p in drawn.lanes} | {c.id for c in drawn.connections}
    assert_neighbours_share(drawn, borders)
    assert_successors_share(drawn, borders)
    assert not any(crossing(borders.values()))
    for lane in drawn.lanes:
        middle = shapely.LineString(sum(borders[lane.id]) / 2)  # type: ignore[arg-type]
        assert middle.hausdorff_distance(shapely.LineString(lane.centerline)) < 0.05
