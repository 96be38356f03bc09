from __future__ import annotations

import math
from typing import Any

import pytest

from contracts.drive import VehicleState
from contracts.frames import GeoPoint
from telemetry.commands import CommandEstimator


def state(**motion: Any) -> VehicleState:
    fields: dict[str, Any] = {
        "vehicle_id": "car",
        "stamp_ns": 0,
        "position": GeoPoint(52.5, 13.4),
        "yaw_rad": 0.0,
        "speed_mps": 5.0,
        "yaw_rate_radps": 0.0,
        "accel_mps2": 0.0,
        "estimated": ("tire_angle_rad",),
    }
    return VehicleState(**(fields | motion))


def test_the_tyre_angle_is_that_of_a_bicycle_on_the_same_circle() -> None:
    command = CommandEstimator(wheelbase_m=2.5).handle(
        state(speed_mps=5.0, yaw_rate_radps=0.5, accel_mps2=-1.5)
    )
    assert command.tire_angle_rad == pytest.approx(math.atan(2.5 / 10.0))
    assert command.accel_mps2 == -1.5
    assert command.estimated


def test_the_angle_is_held_when_the_car_hardly_moves() -> None:
    estimator = CommandEstimator(wheelbase_m=2.5)
    turning = estimator.handle(state(yaw_rate_radps=0.5))
    stopped = estimator.handle(state(speed_mps=0.01, yaw_rate_radps=0.02))
    assert stopped.tire_angle_rad == turning.tire_angle_rad


def test_a_measured_angle_is_taken_as_it_is() -> None:
    measured = state(tire_angle_rad=0.1, yaw_rate_radps=0.9, estimated=())
    assert CommandEstimator(wheelbase_m=2.5).handle(measured).tire_angle_rad == 0.1


def test_a_wheelbase_must_be_positive() -> None:
    with pytest.raises(ValueError, match="wheelbase"):
        CommandEstimator(wheelbase_m=0.0)
