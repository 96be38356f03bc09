"""Tables of a path's nodes, on lines whose values are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from foretwin.geometry.path_nodes import (
    NodePlace,
    between,
    cut_corners,
    headings,
    node_table,
    prolonged,
)


def test_between_two_nodes_all_that_the_table_holds_goes_on_evenly() -> None:
    x_m, y_m = np.array([0.0, 3.0, 6.0]), np.array([0.0, 4.0, 8.0])
    table = node_table(x_m, y_m, headings(x_m, y_m))
    found = between(table, NodePlace(np.array([0, 1]), np.array([0.5, 0.25])))
    assert found[:2] == pytest.approx(np.array([[1.5, 3.75], [2.0, 5.0]]))
    to_the_left = np.array([[-0.8, -0.8], [0.6, 0.6]])
    assert found[2:] == pytest.approx(to_the_left)


def test_headings_go_on_where_a_ring_is_driven_round_twice() -> None:
    angle = np.linspace(0.0, 4.0 * math.pi, 300)
    turned = headings(np.sin(angle), 1.0 - np.cos(angle))
    assert turned[-1] - turned[0] == pytest.approx(4.0 * math.pi, rel=0.01)
    assert np.all(np.diff(turned) >= 0.0)


def test_a_car_cuts_a_corner_and_keeps_to_a_straight() -> None:
    straight = np.arange(10.0)
    assert cut_corners(straight) == pytest.approx(straight)
    corner = np.maximum(straight - 5.0, 0.0)
    assert cut_corners(corner)[5] == pytest.approx((1.0 + 2.0) / 5.0)


def test_beyond_both_ends_it_goes_on_as_the_last_piece_does() -> None:
    arc, values = np.array([0.0, 1.0, 3.0]), np.array([5.0, 7.0, 6.0])
    found = prolonged(np.array([-2.0, 0.5, 5.0]), arc, values)
    assert found == pytest.approx(np.array([1.0, 6.0, 5.0]))
