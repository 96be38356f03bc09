"""What a vehicle's filter and its latest samples say together: the state that is reported."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, wrap_angle
from foretwin.telemetry.estimator.kinematic_filter import (
    ACCEL,
    CURVATURE,
    SPEED,
    YAW,
    KinematicFilter,
    X,
    Y,
)
from foretwin.telemetry.estimator.map_aid import ALIKE_M
from foretwin.telemetry.estimator.measured import MotionSamples


def unmoved_state(
    measured: MotionSamples,
    vehicle_id: str,
    stamp_ns: int,
    position: GeoPoint,
    position_std_m: float | None,
) -> VehicleState:
    """Return the state of a car that has not moved yet: it is somewhere, its heading unknown."""
    estimated = measured.estimated(stamp_ns)
    return VehicleState(
        vehicle_id=vehicle_id,
        stamp_ns=stamp_ns,
        position=position,
        yaw_rad=0.0,
        speed_mps=0.0 if "speed_mps" in estimated else measured.speed_mps,
        yaw_rate_radps=0.0,
        accel_mps2=0.0,
        tire_angle_rad=None if "tire_angle_rad" in estimated else measured.tire_angle_rad,
        steering_wheel_rad=measured.steering_wheel_rad,
        position_std_m=position_std_m,
        estimated=estimated,
        yaw_valid=False,
    )


def moving_state(
    measured: MotionSamples,
    vehicle_id: str,
    stamp_ns: int,
    position: GeoPoint,
    filter_: KinematicFilter,
    *,
    convergence_rad: float,
    wheelbase_m: float,
    standing: bool,
    map_shift_m: tuple[float, float] | None,
    overconfidence: float = 1.0,
) -> VehicleState:
    """Return the state of a car whose heading is known.

    `overconfidence` is by how much the filter's spreads were too small so far. `convergence_rad`
    is the angle of the filter's frame against east; a car that stands has no
    speed, turning or acceleration. Fields without a fresh sample are named in `estimated`.
    """
    estimated = measured.estimated(stamp_ns)
    angle = None if "tire_angle_rad" in estimated else measured.tire_angle_rad
    if angle is None:
        angle = math.atan(wheelbase_m * filter_.mean[CURVATURE])
    spread = overconfidence * np.sqrt(np.maximum(np.diag(filter_.covariance), 0.0))
    position_std_m = math.hypot(spread[X], spread[Y]) / math.sqrt(2.0)
    if map_shift_m is not None:
        position_std_m = math.hypot(position_std_m, ALIKE_M)
    return VehicleState(
        vehicle_id=vehicle_id,
        stamp_ns=stamp_ns,
        position=position,
        yaw_rad=float(wrap_angle(filter_.mean[YAW] - convergence_rad)),
        speed_mps=0.0 if standing else float(filter_.mean[SPEED]),
        yaw_rate_radps=0.0 if standing else filter_.yaw_rate_radps,
        accel_mps2=0.0 if standing else float(filter_.mean[ACCEL]),
        tire_angle_rad=angle,
        steering_wheel_rad=measured.steering_wheel_rad,
        position_std_m=position_std_m,
        yaw_std_rad=float(spread[YAW]),
        speed_std_mps=float(spread[SPEED]),
        map_shift_m=map_shift_m,
        estimated=estimated,
    )
