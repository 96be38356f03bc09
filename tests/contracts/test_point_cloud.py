"""Where sensors sit and how they are turned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.point_cloud import (
    MOST_RAYS,
    Mount,
    base_from_mount,
    base_from_mount_cloud,
    mount_from_base_cloud,
)
from tests.pages import page

DEGREES = st.floats(-180.0, 180.0)


def about(axis: int, angle_deg: float) -> Array:
    """Return the turn about one of base_link's axes, counter-clockwise as it points at one."""
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    turn = np.eye(3)
    one, other = (axis + 1) % 3, (axis + 2) % 3
    turn[one, one] = turn[other, other] = cos
    turn[one, other], turn[other, one] = -sin, sin
    return turn


@given(DEGREES, DEGREES, DEGREES)
def test_a_sensor_is_rolled_pitched_and_turned_in_this_order(
    yaw: float, pitch: float, roll: float
) -> None:
    turn = base_from_mount(Mount(yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll))
    expected = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    assert turn == pytest.approx(expected, abs=1e-12)


def test_a_cloud_of_the_sensor_lies_where_the_sensor_sits() -> None:
    """Its first point is 10 m ahead of a sensor that looks to the left, 2 m up."""
    mount = Mount(forward_m=1.0, left_m=0.5, up_m=2.0, yaw_deg=90.0)
    measured = np.array([[10.0, 0.0, 0.0, 40.0, 3.0, 0.05], [0.0, 7.0, 1.0, 50.0, 4.0, 0.06]])
    cloud = measured.astype(np.float32)
    there = base_from_mount_cloud(cloud, mount)

    assert there[:, :3] == pytest.approx(np.array([[1.0, 10.5, 2.0], [-6.0, 0.5, 3.0]]), abs=1e-5)
    assert np.array_equal(there[:, 3:], cloud[:, 3:])
    assert mount_from_base_cloud(there, mount) == pytest.approx(cloud, abs=1e-5)


def test_the_page_tells_how_many_rays_a_turn_has_at_most() -> None:
    assert f"1 to {MOST_RAYS} | Firings of each ring" in page("reference/sensor.md")
