"""What is known of a car's gyro and steering before its turning is held against a model's."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.motion_record import PERIOD_S, MotionRecord

_STANDS_MPS = 0.1
_LEAST_STILL_S, _LEAST_DRIFT_RADPS = 5, 3e-4
"""So long a car stands that tells its gyro's bias, and by so much that may drift. Chosen."""
_SECOND = round(1.0 / PERIOD_S)
_UNKNOWN_SHARE, _UNKNOWN_OFFSET_RAD = 0.1, 0.02
"""How far a ratio and a zero of the steering may be off where the vehicle file does not say."""


def gyro_at_standstill(record: MotionRecord) -> tuple[float, float]:
    """Return the gyro's bias and its standard deviation, infinite where the car never stands."""
    gyro = record.yaw_rate_radps[record.speed_mps < _STANDS_MPS]
    gyro = gyro[np.isfinite(gyro)]
    seconds = gyro[: len(gyro) // _SECOND * _SECOND].reshape(-1, _SECOND).mean(axis=1)
    if len(seconds) < _LEAST_STILL_S:
        return 0.0, float("inf")
    drift = max(float(np.std(seconds)), _LEAST_DRIFT_RADPS)
    return float(np.median(seconds)), drift


def steering_prior(vehicle: VehicleParameters) -> tuple[float, float]:
    """Return how far gain and steering offset may be off by the vehicle file."""
    ratio, base = (
        (one.std or _UNKNOWN_SHARE * one.value) / one.value
        for one in (vehicle.steering_ratio, vehicle.wheelbase_m)
    )
    return math.hypot(ratio, base), vehicle.steering_offset_rad.std or _UNKNOWN_OFFSET_RAD


def response_std_s(vehicle: VehicleParameters, speed_mps: float) -> float:
    """Return how far a planar car's lag behind its tyres, I_z v (1/C_f + 1/C_r) / L², may be off.

    Rajamani, Vehicle Dynamics and Control, 2012, 2.3; deviations are the vehicle file's.
    """
    front, rear = vehicle.front_cornering_stiffness_npr, vehicle.rear_cornering_stiffness_npr
    inertia, base_m = vehicle.yaw_inertia_kgm2, vehicle.wheelbase_m.value
    per_mps = 1.0 / base_m**2
    soft = 1.0 / front.value + 1.0 / rear.value
    off = (
        (inertia.std or 0.0) * soft,
        inertia.value * (front.std or 0.0) / front.value**2,
        inertia.value * (rear.std or 0.0) / rear.value**2,
    )
    return speed_mps * per_mps * math.hypot(*off)
