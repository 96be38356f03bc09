"""From the measured state of the car to the state that a simulation starts from."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.steering import column_of
from foretwin.sim_worker.vehicle.parameters import understeer_gradient

_MIN_SPEED_MPS = 1.0
"""Below it, a yaw rate says nothing about the steering."""


def local_state(state: VehicleState, frame: LocalFrame, vehicle: VehicleParameters) -> Array:
    """Return (8,) base_link state in `frame`, columns as `futures.STATE_COLUMNS`.

    The lateral velocity of the rear axle is that of steady cornering. Raises UserError where the
    state is not finite.
    """
    state.position.validate()
    xy = local_from_geo(frame, state.position.lat_deg, state.position.lon_deg)
    yaw = local_from_geo_yaw(frame, state.yaw_rad, state.position.lat_deg, state.position.lon_deg)
    row = np.array(
        [
            xy[0],
            xy[1],
            float(yaw),
            state.speed_mps,
            rear_slip_velocity(vehicle, state.speed_mps, state.yaw_rate_radps),
            state.yaw_rate_radps,
            tire_angle(state, vehicle),
            state.accel_mps2,
        ]
    )
    if not np.isfinite(row).all():
        raise UserError(
            f"state of {state.vehicle_id} at {state.stamp_ns} ns is not finite: {row.tolist()}"
        )
    return row


def tire_angle(state: VehicleState, vehicle: VehicleParameters) -> float:
    """Return the tyre angle in radians: measured, else from the steering wheel, else kinematic."""
    if state.tire_angle_rad is not None:
        return state.tire_angle_rad
    if state.steering_wheel_rad is not None:
        return column_of(vehicle).tire_rad(state.steering_wheel_rad)
    return kinematic_tire_angle(vehicle, state.speed_mps, state.yaw_rate_radps)


def kinematic_tire_angle(
    vehicle: VehicleParameters, speed_mps: float, yaw_rate_radps: float
) -> float:
    """Return the tyre angle of steady cornering: atan(L r / v) + K v r; 0 near standstill."""
    if abs(speed_mps) < _MIN_SPEED_MPS:
        return 0.0
    curvature = yaw_rate_radps / speed_mps
    angle = math.atan(vehicle.wheelbase_m.value * curvature)
    angle += understeer_gradient(vehicle) * speed_mps * yaw_rate_radps
    limit = vehicle.max_tire_angle_rad.value
    return min(max(angle, -limit), limit)


def rear_slip_velocity(
    vehicle: VehicleParameters, speed_mps: float, yaw_rate_radps: float
) -> float:
    """Return the lateral velocity in m/s of base_link in steady cornering: -u F_r / C_r."""
    front = vehicle.wheelbase_m.value - vehicle.cog_from_rear_axle_m.value
    rear_force = (
        vehicle.mass_kg.value * front / vehicle.wheelbase_m.value * speed_mps * yaw_rate_radps
    )
    slow = max(abs(speed_mps), _MIN_SPEED_MPS)
    return -slow * rear_force / vehicle.rear_cornering_stiffness_npr.value
