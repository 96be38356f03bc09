"""Turns and bends become those that cars are driven in."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import arc_lengths
from foretwin.orchestrator.routing.rounding import (
    BEND_WITHIN_M,
    FINE_M,
    SIMPLIFY_M,
    STRAIGHT_M,
    TIGHT_M,
    curvature_pm,
    evenly_spaced,
    fillet,
    smoothed,
    with_driven_bends,
    with_driven_turns,
    with_whole_bends,
)

RADII_M = 9.5, 10.5


def turn(angle_rad: float, radius_m: float, leg_m: float = 40.0) -> tuple[Array, Array]:
    """A straight leg to the east, an arc, and another leg; evenly spaced, with its arc lengths."""
    arc_m = abs(angle_rad) * radius_m
    at = np.linspace(0.0, 2.0 * leg_m + arc_m, round((2.0 * leg_m + arc_m) / FINE_M) + 1)
    share = np.clip((at[1:] + at[:-1]) / 2.0 - leg_m, 0.0, arc_m) / arc_m
    step = np.diff(at)[:, None] * np.stack(
        [np.cos(angle_rad * share), np.sin(angle_rad * share)], axis=-1
    )
    xy = np.concatenate([[[0.0, 0.0]], np.cumsum(step, axis=0)])
    return xy, arc_lengths(xy)


@settings(max_examples=40, deadline=None)
@given(angle_rad=st.floats(0.8, 1.8), left=st.booleans(), radius_m=st.floats(4.0, 7.0))
def test_a_tight_turn_gets_the_radius_of_its_side_and_keeps_its_legs(
    angle_rad: float, left: bool, radius_m: float
) -> None:
    xy, s = turn(angle_rad if left else -angle_rad, radius_m)
    wide, places = with_driven_turns(xy, s, RADII_M)
    bend = np.abs(curvature_pm(smoothed(wide, 1.0)))

    assert bend.max() < 1.05 / TIGHT_M
    assert (np.diff(places) > 0.0).all()
    assert wide[0] == pytest.approx(xy[0])
    assert wide[-1] == pytest.approx(xy[-1])
    assert wide[:40, 1] == pytest.approx(xy[:40, 1], abs=0.01)
    heading = np.unwrap(np.arctan2(*np.diff(wide, axis=0).T[::-1]))
    assert np.ptp(heading) == pytest.approx(angle_rad, abs=0.02)


def test_a_turn_as_wide_as_cars_are_driven_stays_as_it_is() -> None:
    xy, s = turn(math.pi / 2, 11.0)
    same, places = with_driven_turns(xy, s, RADII_M)

    assert same is xy
    assert places is s


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_corners_become_arcs_as_wide_as_their_legs_allow_and_other_nodes_stay(side: float) -> None:
    line = np.array(
        [[0.0, 0.0], [20.0, 0.0], [40.0, 0.0], [40.0, side * 20.0], [60.0, side * 20.0]]
    )
    xy, s = fillet(line, 7.0 + arc_lengths(line), np.array([10.0, 10.0, 30.0]))

    assert xy[[0, 1, -1]].tolist() == line[[0, 1, -1]].tolist()
    assert s[[0, 1, -1]].tolist() == [7.0, 27.0, 87.0]
    # A quarter of a circle has 20 points. Both arcs share the leg between them, 10 m and 30 m.
    both = (2, 0.98 * 5.0, [40.0 - 0.98 * 5.0, side * 0.98 * 5.0], 47.0), (
        22, 0.98 * 15.0, [40.0 + 0.98 * 15.0, side * (20.0 - 0.98 * 15.0)], 67.0,
    )  # fmt: skip
    for first, radius_m, centre, at_m in both:
        arc_xy, arc_s = xy[first : first + 20], s[first : first + 20]
        assert np.hypot(*(arc_xy - centre).T) == pytest.approx(radius_m)
        assert arc_s == pytest.approx(np.linspace(at_m - radius_m, at_m + radius_m, 20))
        assert np.hypot(*np.diff(arc_xy, axis=0).T) == pytest.approx(
            2.0 * radius_m * math.sin(math.pi / 76.0)
        )
    assert xy[2] == pytest.approx([40.0 - 4.9, 0.0])
    assert xy[21] == pytest.approx([40.0, side * 4.9])
    assert len(xy) == 43


def test_a_line_without_corners_stays_as_it_is() -> None:
    line = np.array([[0.0, 0.0], [20.0, 0.0], [40.0, 0.0]])
    xy, s = fillet(line, arc_lengths(line), np.array([10.0]))
    assert (xy.tolist(), s.tolist()) == (line.tolist(), [0.0, 20.0, 40.0])


def test_two_turns_close_together_are_widened_as_far_as_they_leave_room() -> None:
    xy, _ = turn(math.pi / 2, 5.0, leg_m=8.0)
    back = xy[-1] + (xy[-1] - xy[::-1])  # the same turn again, so that both make an S
    both = np.concatenate([xy, back[1:]])
    wide, places = with_driven_turns(both, arc_lengths(both), RADII_M)
    bend = curvature_pm(smoothed(wide, 1.0))

    assert np.abs(bend).max() < np.abs(curvature_pm(smoothed(both, 1.0))).max() - 0.02
    assert bend.max() > 0.05
    assert (np.diff(places) > 0.0).all()


def test_a_tight_turn_at_the_very_end_has_no_room_and_stays() -> None:
    xy, s = turn(math.pi / 2, 5.0)
    cut = np.searchsorted(s, 40.0 + 5.0 * math.pi / 4)
    xy, s = xy[:cut], s[:cut]
    kept, places = with_driven_turns(xy, s, RADII_M)

    assert kept == pytest.approx(xy, abs=0.1)
    assert places[[0, -1]] == pytest.approx(s[[0, -1]])


def arc(radius_m: float, *, piece_m: float, turned_rad: float = 1.0) -> tuple[Array, Array]:
    """A bend of the road as a map draws it, spaced as the lines that are worked on."""
    nodes = np.arange(0.0, turned_rad, piece_m / radius_m)
    line = radius_m * np.stack([np.sin(nodes), 1.0 - np.cos(nodes)], axis=-1)
    return evenly_spaced(line, arc_lengths(line))


def heading_error_rad(line: Array, radius_m: float) -> float:
    """How far a line's heading is from that of the circle which it stands for, but for its ends."""
    heading = np.unwrap(np.arctan2(*np.diff(line, axis=0).T[::-1]))
    x, y = ((line[1:] + line[:-1]) / 2.0).T
    off = (heading - np.arctan2(x, radius_m - y))[20:-20]
    return float(np.sqrt((off**2).mean()))


@settings(max_examples=40, deadline=None)
@given(radius_m=st.floats(150.0, 2000.0), piece_m=st.floats(15.0, 80.0))
def test_a_bend_drawn_in_straight_pieces_is_driven_in_a_curve(
    radius_m: float, piece_m: float
) -> None:
    if piece_m > 0.3 * radius_m:
        piece_m = 0.3 * radius_m  # a map maker draws a bend, no polygon
    drawn, s = arc(radius_m, piece_m=piece_m)
    driven, place = evenly_spaced(*with_driven_bends(drawn, s))
    away = np.abs(np.hypot(driven[:, 0], driven[:, 1] - radius_m) - radius_m)
    assert away.max() < SIMPLIFY_M + piece_m**2 / (4.0 * radius_m)
    assert (np.diff(place) > 0.0).all()
    off_rad = [heading_error_rad(line, radius_m) for line in (drawn, driven)]
    assert off_rad[1] < off_rad[0]
    if piece_m**2 / radius_m < 2.0:  # else arcs would leave the nodes by more than they may
        assert off_rad[1] < 0.85 * off_rad[0]


def test_a_bend_drawn_finely_and_a_corner_stay_as_they_are() -> None:
    corner = np.array([[0.0, 0.0], [60.0, 0.0], [110.0, 30.0]])
    for drawn, s in (arc(40.0, piece_m=2.0), evenly_spaced(corner, arc_lengths(corner))):
        driven, place = evenly_spaced(*with_driven_bends(drawn, s))
        near = np.stack([np.interp(s, place, driven[:, i]) for i in (0, 1)], axis=-1)
        assert np.hypot(*(near - drawn).T).max() < STRAIGHT_M + 0.01


def test_the_corners_of_a_bend_become_one_bend() -> None:
    # Five corners of 8 degrees, 12 m apart, as a hand draws a bend of 90 m, half a metre off.
    heading = np.radians(8.0) * np.arange(6)
    legs_m = np.array([60.0, 12.0, 12.0, 12.0, 12.0, 60.0])
    step = legs_m[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    line = np.concatenate([[[0.0, 0.0]], np.cumsum(step, axis=0)])
    line[3] += 0.5 * np.array([math.sin(0.28), -math.cos(0.28)])
    drawn, _ = evenly_spaced(*with_driven_bends(*evenly_spaced(line, arc_lengths(line))))
    driven = with_whole_bends(drawn)

    bend = [np.abs(curvature_pm(smoothed(xy, 1.0))).max() for xy in (drawn, driven)]
    assert bend[0] > 0.026
    assert bend[1] < 0.6 * bend[0]
    assert bend[1] > 1.0 / 90.0
    assert 0.1 < np.hypot(*(driven - drawn).T).max() < BEND_WITHIN_M
    assert driven[:60] == pytest.approx(drawn[:60], abs=0.005)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_bend_that_is_drawn_round_stays_where_it_is(side: float) -> None:
    xy, _ = turn(side * 0.9, 60.0)
    assert with_whole_bends(xy)[120:-120] == pytest.approx(xy[120:-120], abs=0.02)
    assert with_whole_bends(xy) == pytest.approx(xy, abs=0.15)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turn_at_a_junction_is_no_bend(side: float) -> None:
    xy, _ = turn(side * math.pi / 2, 10.0)
    assert np.hypot(*(with_whole_bends(xy) - xy).T).max() < 0.05


@settings(max_examples=40, deadline=None)
@given(angles=st.lists(st.floats(-0.7, 0.7), min_size=2, max_size=5), leg_m=st.floats(10.0, 60.0))
def test_bends_leave_the_line_of_the_map_by_a_metre_at_most(
    angles: list[float], leg_m: float
) -> None:
    heading = np.cumsum([0.0, *angles])
    step = leg_m * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    line = np.concatenate([[[0.0, 0.0]], np.cumsum(step, axis=0)])
    drawn, _ = evenly_spaced(line, arc_lengths(line))
    driven = with_whole_bends(drawn)

    assert (
        np.hypot(*(driven - drawn).T).max() <= BEND_WITHIN_M + 0.005
    )  # what is left of the share is smoothed
    assert driven[[0, -1]] == pytest.approx(drawn[[0, -1]])
    length = np.hypot(*np.diff(driven, axis=0).T)
    assert 0.5 * FINE_M < length.min() <= length.max() < 1.5 * FINE_M
