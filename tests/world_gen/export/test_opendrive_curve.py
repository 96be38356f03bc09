"""Curves through polylines begin and end as they must, stay near, and never run back."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from foretwin.world_gen.export.opendrive_curve import fit_curve

STEPS = st.lists(
    st.tuples(st.floats(0.2, 30.0), st.floats(-25.0, 25.0)), min_size=1, max_size=12
)  # metres, and degrees turned before them


def polyline(steps: list[tuple[float, float]]) -> np.ndarray:
    angles = np.cumsum([math.radians(turn) for _, turn in steps])
    moves = np.array(
        [[d * math.cos(a), d * math.sin(a)] for (d, _), a in zip(steps, angles, strict=True)]
    )
    return np.round(np.concatenate([[[0.0, 0.0]], np.cumsum(moves, axis=0)]), 3)


@given(steps=STEPS)
def test_a_curve_stays_by_its_polyline_and_never_runs_back(steps) -> None:
    line = polyline(steps)
    curve = fit_curve(line)
    total = shapely.LineString(line).length
    assert 0.9 * total < curve.length_m < 1.1 * total
    at, headings = curve.at(np.linspace(0.0, curve.length_m, 400))
    assert np.allclose(at[[0, -1]], line[[0, -1]], atol=1e-9)
    assert shapely.LineString(line).distance(shapely.points(at)).max() < 0.6
    # Evaluated as readers do, each step is about as long as the length says.
    steps_m = np.hypot(*np.diff(at, axis=0).T)
    assert steps_m.min() > 0.2 * curve.length_m / 400
    turns = np.abs(
        np.arctan2(
            headings[:-1, 0] * headings[1:, 1] - headings[:-1, 1] * headings[1:, 0],
            (headings[:-1] * headings[1:]).sum(axis=1),
        )
    )
    assert turns.max() < math.radians(90.0)


@pytest.mark.parametrize("degrees", [-150.0, -90.0, -20.0, 0.0, 45.0, 90.0, 135.0])
def test_a_turn_takes_few_pieces_and_has_the_headings_asked_for(degrees: float) -> None:
    turn = math.radians(degrees)
    begin, heading = np.zeros(2), np.array([1.0, 0.0])
    toward = np.array([math.cos(turn), math.sin(turn)])
    corner, finish = 12.0 * heading, 12.0 * heading + 9.0 * toward
    t = np.linspace(0.0, 1.0, 18)[:, None]
    bend = (1 - t) ** 2 * (corner - 5.0 * heading) + 2 * t * (1 - t) * corner
    bend += t**2 * (corner + 5.0 * toward)
    line = np.round(np.concatenate([[begin, [2.5, 0.0]], bend, [finish]]), 3)
    curve = fit_curve(line, start=heading, end=toward)
    points, headings = curve.at([0.0, curve.length_m])
    assert np.allclose(points, [begin, finish], atol=1e-3)
    assert np.allclose(headings, [heading, toward], atol=1e-9)
    assert len(curve.straight) <= 6
    on_curve = shapely.LineString(curve.at(np.linspace(0.0, curve.length_m, 200))[0])
    assert shapely.hausdorff_distance(on_curve, shapely.LineString(line)) < 0.05


def test_a_line_without_length_is_refused() -> None:
    with pytest.raises(ValueError, match="no length"):
        fit_curve(np.array([[1.0, 2.0], [1.0, 2.0]]))
