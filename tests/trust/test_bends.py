"""Errors along and across a way, and bends that are driven faster than planners take them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.trust.bends import parts, too_fast


def circle(radius_m: float) -> np.ndarray:
    angle = np.arange(0.0, 60.0) / radius_m
    return radius_m * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])


def test_an_error_has_a_part_along_the_way_and_one_across() -> None:
    ahead, left = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
    way = np.arange(5.0)[:, None] * ahead
    found = parts(way - 2.0 * ahead + 0.3 * left, way)

    np.testing.assert_allclose(found.along_m, 2.0)
    np.testing.assert_allclose(found.across_m, 0.3)


def test_of_a_car_that_stands_all_is_along() -> None:
    found = parts(np.full((5, 2), [3.0, 4.0]), np.zeros((5, 2)))

    np.testing.assert_allclose(found.along_m, 5.0)
    np.testing.assert_allclose(found.across_m, 0.0)


@pytest.mark.parametrize(("speed_mps", "fast"), [(9.8, False), (10.2, False), (10.6, True)])
def test_a_bend_of_40_m_is_taken_at_10_mps(speed_mps: float, fast: bool) -> None:
    """Of which 0.3 m/s more are not counted."""
    way = circle(40.0)
    found = too_fast(way, way[20:30], np.full(10, speed_mps))

    assert found.tolist() == [fast] * 10
