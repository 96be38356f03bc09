"""Where sensors sit and how they are turned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.contracts.point_cloud import Mount, base_from_mount

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
