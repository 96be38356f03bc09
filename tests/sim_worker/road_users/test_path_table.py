"""Places on many paths at once agree with the same places on each path alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.road_users.path_table import PathTable

CIRCLE = FrenetPath(
    np.stack([30.0 * np.cos(np.linspace(0, 2, 60)), 30.0 * np.sin(np.linspace(0, 2, 60))], axis=1)
)
STRAIGHT = FrenetPath(np.array([[5.0, -40.0], [5.0, 90.0]]), before_m=50.0)
TABLE = PathTable([CIRCLE, STRAIGHT])


@given(
    which=st.lists(st.integers(0, 1), min_size=1, max_size=8),
    arc=st.floats(-15.0, 55.0),
    lateral=st.floats(-4.0, 4.0),
)
def test_poses_are_those_of_each_path_alone(which: list[int], arc: float, lateral: float) -> None:
    places = np.array(which)
    arcs = np.full(len(places), arc)
    found = TABLE.poses(TABLE.place(TABLE.on(places), arcs), np.full(len(places), lateral))
    for row, path in zip(found, (TABLE.paths[i] for i in which), strict=True):
        alone = path.pose_at(np.array([arc]), lateral)
        assert row[2] == pytest.approx(alone.yaw_rad[0], abs=1e-9)
        # Between nodes one interpolates headings, the other their cosines.
        assert row[:2] == pytest.approx(alone.xy_m[0], abs=2e-3)


def test_beyond_their_ends_paths_go_on_straight() -> None:
    first, last = STRAIGHT.arc_m[[0, -1]]
    arcs = np.array([first - 30.0, first, last, last + 50.0])
    found = TABLE.poses(TABLE.place(TABLE.on(np.ones(4, dtype=np.intp)), arcs))
    assert np.diff(found[:, :2], axis=0).tolist() == [
        pytest.approx(row) for row in ([0.0, 30.0], [0.0, last - first], [0.0, 50.0])
    ]
    assert found[:, 2] == pytest.approx(np.full(4, math.pi / 2))


def test_a_crossing_road_is_found_on_the_other_path_without_a_search() -> None:
    east = FrenetPath(np.array([[-50.0, 0.0], [80.0, 0.0]]))
    place = TABLE.place(TABLE.on(np.array([1])), np.array([25.0]))
    arc, offset, turned = TABLE.along(east).at(place)
    # 25 m along the northbound path is 15 m south of the eastbound one, at x = 5.
    assert (arc[0], offset[0], turned[0]) == pytest.approx((55.0, -15.0, np.pi / 2), abs=1e-6)


def test_a_table_without_paths_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one path"):
        PathTable([])
