"""Paths through junctions as they were driven: near the pass, tangent to their lanes, drivable."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.geometry.polyline import arc_lengths, unit
from foretwin.geometry.steering import LEAST_RADIUS_M
from foretwin.world_gen.driven.driven_paths import driven_path


def arc(radius_m: float) -> np.ndarray:
    angle = np.linspace(0.0, np.pi / 2.0, 30)
    return radius_m * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)


@settings(max_examples=30)
@given(st.floats(10.0, 20.0), st.floats(-0.7, 0.7))
def test_a_path_follows_its_pass_and_keeps_its_ends(radius_m: float, aside_m: float) -> None:
    drawn = arc(radius_m)
    angle = np.linspace(-0.3, np.pi / 2.0 + 0.3, 60)
    bulge = radius_m - aside_m * np.exp(-(((angle - np.pi / 4.0) / 0.45) ** 2))
    seen = np.stack([bulge * np.sin(angle), radius_m - bulge * np.cos(angle)], axis=1)

    path = driven_path(drawn, [seen])

    assert path is not None
    assert np.array_equal(path[[0, -1]], drawn[[0, -1]])
    assert unit(path[1] - path[0]) @ unit(drawn[1] - drawn[0]) > 0.995
    middle = path[len(path) // 2]
    assert abs(np.hypot(middle[0], middle[1] - radius_m) - (radius_m - aside_m)) < 0.3
    step = np.diff(path, axis=0)
    turned = np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))
    assert np.abs(turned / np.diff(arc_lengths(path))[1:]).max() < 1.1 / LEAST_RADIUS_M


def test_a_pass_along_no_drivable_line_changes_nothing() -> None:
    drawn = arc(4.2)
    wild = drawn + np.stack([np.zeros(30), 3.0 * np.sin(np.linspace(0.0, 12.0, 30))], axis=1)

    path = driven_path(drawn, [wild])

    if path is not None:
        step = np.diff(path, axis=0)
        turned = np.abs(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))).sum()
        assert turned < np.pi / 2.0 + np.radians(31.0)


def test_a_pass_elsewhere_is_none() -> None:
    assert driven_path(arc(10.0), [np.array([[40.0, 0.0], [40.0, 50.0]])]) is None
