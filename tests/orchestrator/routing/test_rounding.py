"""Turns that are widened to those that cars are driven in."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import arc_lengths
from foretwin.orchestrator.routing.rounding import (
    FINE_M,
    TIGHT_M,
    curvature_pm,
    smoothed,
    with_driven_turns,
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
