"""Drives of CommonRoad's single-track and multi-body models, to hold the planar vehicle against.

Althoff and Würsching, CommonRoad: Vehicle Models (2020); integrated by Runge-Kutta of order 4 in
steps of 1 ms (single-track: 2 ms).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from vehiclemodels.init_mb import init_mb
from vehiclemodels.init_st import init_st
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from foretwin.contracts.arrays import Array

Kind = Literal["single-track", "multi-body"]
NUMBERS = {"ford_escort": 1, "bmw_320i": 2, "vw_vanagon": 3}
"""CommonRoad's number of each vehicle that comes from there."""


class Drive(NamedTuple):
    """Time, distance from the start, speed along the body and yaw rate, each (N,)."""

    time_s: Array
    x_m: Array
    speed_mps: Array
    yaw_rate_radps: Array


def drive(
    name: str, kind: Kind, *, speed_mps: float, duration_s: float,
    tire: Callable[[float], float] = lambda _: 0.0,
    accel: Callable[[float], float] | None = None,
) -> Drive:  # fmt: skip
    """Drive with the tyre angle of a time and the acceleration of a speed, None to hold it."""
    vehicle = setup_vehicle_parameters(NUMBERS[name])
    start = [0.0, 0.0, 0.0, speed_mps, 0.0, 0.0, 0.0]
    multi_body = kind == "multi-body"
    state = np.array(init_mb(start, vehicle) if multi_body else init_st(start))
    slopes = vehicle_dynamics_mb if multi_body else vehicle_dynamics_st
    step = 0.001 if multi_body else 0.002

    def slope(at: Array, command: list[float]) -> Array:
        return np.array(slopes(at.tolist(), list(command), vehicle))

    count = round(duration_s / step)
    rows, sum_of_errors = np.empty((count, 4)), 0.0
    limit = vehicle.steering.v_max
    for k in range(count):
        # The multi-body model's speed is that along the body, the single-track model's the whole.
        speed = state[3] if multi_body else state[3] * np.cos(state[6])
        rows[k] = k * step, state[0], speed, state[5]
        rate = float(np.clip((tire(k * step) - state[2]) / step, -limit, limit))
        if accel is None:
            sum_of_errors += (speed_mps - speed) * step
            wanted = float(np.clip(5.0 * (speed_mps - speed) + 3.0 * sum_of_errors, -5.0, 5.0))
        else:
            wanted = accel(float(speed))
        command = [rate, wanted]
        one = slope(state, command)
        two = slope(state + step / 2 * one, command)
        three = slope(state + step / 2 * two, command)
        four = slope(state + step * three, command)
        state = state + step / 6 * (one + 2 * two + 2 * three + four)
    return Drive(*rows.T)
