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
    start, end = (motion(vectors, np.array([at])) for at in (0.0, 1.0))
    np.testing.assert_allclose(start.velocity, [[5.0, u]], atol=1e-9)
    np.testing.assert_allclose(end.velocity, [[v, 4.0]], atol=1e-9)
    np.testing.assert_allclose(
        [start.curvature_pm[0], end.curvature_pm[0]], [bend, end_bend], atol=1e-9
    )


def test_points_lie_where_the_velocities_lead():
    vectors = _curve((8.0, 5.0), (9.0, 0.0), (0.0, 7.0), 0.02, -0.05)
    at = np.linspace(0.0, 1.0, 2001)
    many = np.repeat(vectors, len(at), axis=1)
    found = motion(many, at)
    summed = np.cumsum((found.velocity[1:] + found.velocity[:-1]) / 2.0 / 2000.0, axis=0)
    np.testing.assert_allclose(displacements(many, at)[1:], summed, atol=1e-5)
    yaw = np.arctan2(found.velocity[:, 1], found.velocity[:, 0])
    bent = np.gradient(yaw, 1.0 / 2000.0) / found.speed
    np.testing.assert_allclose(found.curvature_pm[5:-5], bent[5:-5], atol=1e-4)


def test_a_curve_turns_no_farther_than_its_vectors():
    quarter = _curve((10.0, 10.0), (12.0, 0.0), (0.0, 12.0))
    np.testing.assert_allclose(turned_rad(quarter), np.pi / 2.0)
    shift = _curve((12.0, 3.5), (12.0, 0.0), (12.0, 0.0))
    assert turned_rad(shift)[0] > 2.0 * np.arctan2(3.5, 12.0)
