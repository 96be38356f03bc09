"""Radar lists on screen: where the returns are, red what comes nearer, blue what goes away."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr

from foretwin.contracts.point_cloud import Mount
from foretwin.contracts.radar_list import RadarList
from foretwin.viewer.log_radar_list import PATH, colours_of, rows_of_radar_list
from tests.viewer.test_log_road_users import cells


def test_returns_are_drawn_where_they_are() -> None:
    one = RadarList(
        stamp_ns=0, sensor="a b", mount=Mount(forward_m=3.0, up_m=0.5),
        returns=np.array([[10.0, 0.0, 0.0, -4.0, 10.0], [5.0, np.pi / 2, 0.0, 0.0, 3.0]], "f4"),
    )  # fmt: skip
    (row,) = rows_of_radar_list(one, 7)

    assert (row.path, row.drive_ns) == (f"{PATH}/a\\ b", 7)
    assert isinstance(row.components, rr.Points3D)
    assert np.array(cells(row.components.positions)) == pytest.approx(
        np.array([[13.0, 0.0, 0.5], [3.0, 5.0, 0.5]]), abs=1e-5
    )


def test_red_comes_nearer_and_blue_goes_away() -> None:
    nearer, stands, farther, faster = colours_of(np.array([-10.0, 0.0, 10.0, -50.0])).tolist()

    assert nearer == faster
    assert nearer[0] > 200 > nearer[2]
    assert farther[2] > 200 > farther[0]
    assert len(set(stands)) == 1
