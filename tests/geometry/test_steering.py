"""Steering wheels and tyres: angles lead there and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.geometry.steering import SteeringColumn


def test_the_offset_is_one_of_the_tyres_not_of_the_wheel() -> None:
    column = SteeringColumn(ratio=16.0, offset_rad=0.01)
    assert column.tire_rad(0.0) == 0.01
    np.testing.assert_allclose(column.tire_rad(np.array([1.6, -1.6])), [0.11, -0.09])


@given(ratio=st.floats(8.0, 25.0), offset=st.floats(-0.05, 0.05), wheel=st.floats(-10.0, 10.0))
def test_wheels_are_found_again_from_tyres(ratio: float, offset: float, wheel: float) -> None:
    column = SteeringColumn(ratio, offset)
    assert column.wheel_rad(column.tire_rad(wheel)) == pytest.approx(wheel, abs=1e-9)
