"""Clouds on screen: points of the last turn, few enough, and brighter where more light came."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr

from foretwin.contracts.point_cloud import PointCloud
from foretwin.viewer.log_point_cloud import MOST_POINTS, PATH, PointCloudLog
from tests.viewer.test_log_road_users import cells


def cloud(count: int, sensor: str = "a b") -> PointCloud:
    points = np.arange(count * 6, dtype=np.float32).reshape(count, 6)
    points[:, 3] = np.linspace(0.0, 100.0, count)
    return PointCloud(stamp_ns=0, points=points, sensor=sensor)


def test_points_are_those_of_the_cloud_and_the_bright_ones_are_light() -> None:
    (row,) = PointCloudLog().rows(cloud(3), 7)
    assert (row.path, isinstance(row.components, rr.Points3D)) == (f"{PATH}/a\\ b", True)
    assert np.array(cells(row.components.positions)) == pytest.approx(cloud(3).points[:, :3])
    dark, _, bright = (one >> 24 for one in cells(row.components.colors))
    assert dark < bright


def test_a_turn_is_thinned_out_and_none_is_too_small() -> None:
    for count in (0, 1, MOST_POINTS, MOST_POINTS + 1, 10 * MOST_POINTS):
        (row,) = PointCloudLog().rows(cloud(count), 0)
        drawn = len(cells(row.components.positions))
        assert min(count, MOST_POINTS // 2) <= drawn <= MOST_POINTS


def test_each_sensor_is_drawn_ten_times_a_second() -> None:
    log = PointCloudLog()
    drawn = [bool(log.rows(cloud(3), k * 50_000_000)) for k in range(4)]
    assert drawn == [True, False, True, False]
    assert log.rows(cloud(3, "other"), 150_000_000)
