"""The engine `multibody`: S cars of CommonRoad's multi-body model, side by side.

Slip is divided by the speed, so below 0.8 m/s (above 1 m/s when speeding up), and backwards, wheels
roll without slip instead: the kinematic bicycle.
"""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.compiled import IN, OUT, OUT_ROWS, REAL, kernel, types
from foretwin.geometry.multibody_equations import (
    BODY_TYPE,
    GRAVITY_MPS2,
    STATES,
    TYRE_TYPE,
    slope,
)
from foretwin.sim_worker.engines.engine import Demand, Seeds
from foretwin.sim_worker.engines.multibody_car import multibody_car
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S

_SLOW_MPS, _ROLLING_MPS = 0.8, 1.0
_STABLE, _LOADED = 2.0, 1.6
"""The most that a step times the stiffest rate may be (Runge-Kutta of order 4 allows 2.78), and how
much more than at rest a wheel may bear."""
_LEAST_STEPS, _MOST_STEPS = 2, 60
_FLAGS = types.boolean[:]


@kernel(types.void, OUT, REAL, REAL, REAL, REAL, REAL, REAL, REAL, BODY_TYPE)
def begin(
    x: Array,
    at_x: float,
    at_y: float,
    yaw: float,
    speed: float,
    lateral: float,
    yaw_rate: float,
    steer: float,
    body: tuple[float, ...],
) -> None:
    """Fill a state (29,), its centre of gravity at (x, y), with springs at rest and wheels that
    roll (`vehiclemodels.init_mb`)."""
    m_s, m_uf, m_ur, a, b = body[1:6]
    stiff, radius = body[20], body[28]
    x[:] = 0.0
    x[0], x[1], x[2], x[3], x[4], x[5] = at_x, at_y, steer, speed, yaw, yaw_rate
    x[10], x[15], x[20] = lateral, lateral + a * yaw_rate, lateral - b * yaw_rate
    x[16] = (m_s * b / (a + b) + m_uf) * GRAVITY_MPS2 / (2.0 * stiff)
    x[21] = (m_s * a / (a + b) + m_ur) * GRAVITY_MPS2 / (2.0 * stiff)
    x[23:27] = max(speed, 0.0) / radius


@kernel(
    types.void, OUT_ROWS, _FLAGS, IN, IN, IN, types.Array(REAL, 2, "A"), IN, REAL, REAL,
    types.UniTuple(REAL, 5), BODY_TYPE, TYRE_TYPE, OUT_ROWS,
)  # fmt: skip
def advance(
    states: Array,
    slips: Array,
    drive: Array,
    brake: Array,
    climb: Array,
    angles: Array,
    grip: Array,
    drag_pm: float,
    rolling_mps2: float,
    car: tuple[float, ...],
    body: tuple[float, ...],
    tyre: tuple[float, ...],
    out: Array,
) -> None:
    """Advance `states` (S, 29) through the steps of `angles` (steps, S); fill `out` (7, S) with
    base_link's. `slips` (S,) says who is in multi-body motion, and keeps it."""
    front_stiffness, rear_stiffness, linkage, factor, spin_rate = car
    a, b = body[4], body[5]
    k1, k2, k3, k4 = np.empty(29), np.empty(29), np.empty(29), np.empty(29)
    for one in range(states.shape[0]):
        x = states[one]
        for step in range(angles.shape[0]):
            speed, target = x[3], angles[step, one]
            if slips[one] and speed < _SLOW_MPS:
                slips[one] = False
            elif not slips[one] and speed > _ROLLING_MPS:
                slips[one] = True
            if slips[one]:
                stiffest = _LOADED * spin_rate / speed * TIMESTEP_S / _STABLE
                parts = min(max(math.ceil(stiffest), _LEAST_STEPS), _MOST_STEPS)
                dt, rate = TIMESTEP_S / parts, (target - x[2]) / TIMESTEP_S
                for _ in range(parts):
                    pull = climb[one] + rolling_mps2 + drag_pm * x[3] * x[3]
                    given = (rate, drive[one], brake[one], pull, grip[one])
                    scales = (front_stiffness, rear_stiffness, linkage)
                    slope(x, *given, *scales, body, tyre, k1)
                    slope(x + 0.5 * dt * k1, *given, *scales, body, tyre, k2)
                    slope(x + 0.5 * dt * k2, *given, *scales, body, tyre, k3)
                    slope(x + dt * k3, *given, *scales, body, tyre, k4)
                    x += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                    for wheel in range(23, 27):
                        x[wheel] = max(x[wheel], 0.0)
                continue
            free = (drive[one] - climb[one] - drag_pm * speed * abs(speed)) / factor
            then = speed + free * TIMESTEP_S
            held = (brake[one] + rolling_mps2) / factor * TIMESTEP_S
            then = math.copysign(max(abs(then) - held, 0.0), then)
            way, yaw = 0.5 * (speed + then) * TIMESTEP_S, x[4]
            bend = math.tan(target) / (a + b)
            turn = way * bend
            base_x, base_y = x[0] - b * math.cos(yaw), x[1] - b * math.sin(yaw)
            base_x += way * math.cos(yaw + 0.5 * turn)
            base_y += way * math.sin(yaw + 0.5 * turn)
            yaw += turn
            begin(
                x, base_x + b * math.cos(yaw), base_y + b * math.sin(yaw), yaw, then,
                b * then * bend, then * bend, target, body,
            )  # fmt: skip
        out[0, one], out[1, one] = x[0] - b * math.cos(x[4]), x[1] - b * math.sin(x[4])
        out[2, one], out[3, one], out[4, one] = x[4], x[3], x[10] - b * x[5]
        out[5, one], out[6, one] = x[5], x[2]


class MultiBody:
    """Cars of `vehicle`, all of whose wheels, springs and tyres are there."""

    def __init__(self, vehicle: VehicleParameters, *, count: int) -> None:
        self._car = multibody_car(vehicle)
        self._rear_m = vehicle.cog_from_rear_axle_m.value
        mass = vehicle.mass_kg.value
        self._drag_pm = vehicle.drag_npv2.value / mass
        self._rolling_mps2 = vehicle.rolling_resistance_n.value / mass
        self._states = np.zeros((count, STATES))
        self._slips = np.zeros(count, dtype=bool)
        self._grip = np.ones(count)

    def reset(self, rows: Indices, seeds: Seeds) -> None:
        """Let cars begin with springs at rest, and their wheels rolling."""
        self._grip[rows] = self._car.grip_per_friction * seeds.friction
        self._slips[rows] = (seeds.states[:, 3] > _SLOW_MPS) & ~seeds.backwards
        for row, (x, y, yaw, vx, vy, rate, steer, _) in zip(rows, seeds.states, strict=True):
            ahead_x, ahead_y = self._rear_m * math.cos(yaw), self._rear_m * math.sin(yaw)
            lateral = vy + self._rear_m * rate
            at = (x + ahead_x, y + ahead_y, yaw, vx, lateral, rate, steer)
            begin(self._states[row], *at, self._car.body)

    def step(self, demand: Demand) -> Array:
        """Advance by one control tick; return base_link's columns (7, S)."""
        car, count = self._car, demand.tire_angle_rad.shape[1]
        out = np.empty((7, count))
        advance(
            self._states[:count],
            self._slips[:count],
            demand.drive_mps2,
            demand.brake_mps2,
            demand.climb_mps2,
            demand.tire_angle_rad,
            self._grip[:count],
            self._drag_pm,
            self._rolling_mps2,
            (
                car.front_stiffness,
                car.rear_stiffness,
                car.linkage,
                car.inertia_factor,
                car.spin_rate_mps2,
            ),
            car.body,
            car.tyre,
            out,
        )
        return out

    def close(self) -> None:
        """Nothing was started."""
