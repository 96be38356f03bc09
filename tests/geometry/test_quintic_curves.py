"""Quintic curves have the ends, headings and curvatures that their vectors were made for."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.quintic_curves import control_vectors, displacements, motion, turned_rad

numbers = st.floats(-10.0, 10.0)
bends = st.floats(-0.2, 0.2)


def _curve(gap, velocity, end_velocity, bend=0.0, end_bend=0.0) -> np.ndarray:
    one = (np.array([v], dtype=float) for v in (gap, velocity, end_velocity, bend, end_bend))
    return control_vectors(*one)


@given(x=numbers, y=numbers, u=numbers, v=numbers, bend=bends, end_bend=bends)
def test_a_curve_ends_where_and_as_it_shall(x, y, u, v, bend, end_bend):
    vectors = _curve((x, y), (5.0, u), (v, 4.0), bend, end_bend)
    np.testing.assert_allclose(displacements(vectors, np.array([1.0])), [[x, y]], atol=1e-9)
    found = motion(vectors, np.array([0.0, 1.0]))
    np.testing.assert_allclose(found.velocity[:, 0], [[5.0, u], [v, 4.0]], atol=1e-9)
    np.testing.assert_allclose(found.curvature_pm[:, 0], [bend, end_bend], atol=1e-9)


def test_points_lie_where_the_velocities_lead():
    vectors = _curve((8.0, 5.0), (9.0, 0.0), (0.0, 7.0), 0.02, -0.05)
    at = np.linspace(0.0, 1.0, 2001)
    other = _curve((6.0, -4.0), (8.0, 0.0), (0.0, -6.0))
    velocity, speed, curvature_pm = (
        values[:, 0] for values in motion(np.concatenate([vectors, other], axis=1), at)
    )
    summed = np.cumsum((velocity[1:] + velocity[:-1]) / 2.0 / 2000.0, axis=0)
    along = displacements(np.repeat(vectors, len(at), axis=1), at)
    np.testing.assert_allclose(along[1:], summed, atol=1e-5)
    bent = np.gradient(np.arctan2(velocity[:, 1], velocity[:, 0]), 1.0 / 2000.0) / speed
    np.testing.assert_allclose(curvature_pm[5:-5], bent[5:-5], atol=1e-4)


def test_a_curve_turns_no_farther_than_its_vectors():
    quarter = _curve((10.0, 10.0), (12.0, 0.0), (0.0, 12.0))
    np.testing.assert_allclose(turned_rad(quarter), np.pi / 2.0)
    shift = _curve((12.0, 3.5), (12.0, 0.0), (12.0, 0.0))
    assert turned_rad(shift)[0] > 2.0 * np.arctan2(3.5, 12.0)
