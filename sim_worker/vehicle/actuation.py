"""From commanded acceleration to forces: gains, resistances, load transfer, the friction limit.

Vectorised over S simulations; the arrays it writes are those of a Batch, or of one model with a
leading axis of 1.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from contracts.arrays import Array
from contracts.vehicle import VehicleParameters
from sim_worker.vehicle.parameters import GRAVITY_MPS2
from sim_worker.vehicle.planar import BRAKE, DRIVE, STEER, TYRE_FRONT, TYRE_REAR

_MIN_SPEED_MPS = 1.0
"""Below it tyres act as dampers: slip angles lose their meaning towards standstill."""
_MIN_LATERAL_SHARE = 0.2
"""Of the friction limit, left to lateral force under full braking: a real ABS leaves that much."""
_TINY_N = 1e-9
"""A force range of exactly 0 would mean unlimited."""


class ActuatorIds(NamedTuple):
    """Indices of the vehicle's actuators in a compiled model."""

    tyre_front: int
    tyre_rear: int
    brake: int
    drive: int
    steer: int


def actuator_ids(model: mujoco.MjModel, prefix: str) -> ActuatorIds:
    """Find the actuators of the vehicle attached under `prefix`; KeyError where there is none."""
    names = (TYRE_FRONT, TYRE_REAR, BRAKE, DRIVE, STEER)
    return ActuatorIds(*(model.actuator(prefix + name).id for name in names))


class Actuation:
    """Writes tyre stiffness, force limits and drive force of S vehicles at each control tick.

    `ctrl` (S, nu), `biasprm` (S, nu, k) and `forcerange` (S, nu, 2) are written in place.
    """

    def __init__(
        self,
        vehicle: VehicleParameters,
        ids: ActuatorIds,
        *,
        ctrl: Array,
        biasprm: Array,
        forcerange: Array,
    ) -> None:
        self._ids = ids
        self._ctrl, self._biasprm, self._forcerange = ctrl, biasprm, forcerange
        self._mass = vehicle.mass_kg.value
        wheelbase = vehicle.wheelbase_m.value
        rear = vehicle.cog_from_rear_axle_m.value
        self._front_load = self._mass * GRAVITY_MPS2 * rear / wheelbase
        self._rear_load = self._mass * GRAVITY_MPS2 * (wheelbase - rear) / wheelbase
        self._transfer = self._mass * vehicle.cog_height_m.value / wheelbase
        self._front_stiffness = vehicle.front_cornering_stiffness_npr.value / self._front_load
        self._rear_stiffness = vehicle.rear_cornering_stiffness_npr.value / self._rear_load
        self._effective = vehicle.wheel_inertia_mass_factor.value
        self._drive_gain = vehicle.drive_gain.value / self._effective
        self._brake_gain = vehicle.brake_gain.value / self._effective
        self._max_drive = vehicle.max_drive_accel_mps2.value
        self._max_brake = vehicle.max_brake_decel_mps2.value
        self._drag = vehicle.drag_npv2.value / self._effective
        self._rolling = vehicle.rolling_resistance_n.value / self._effective + _TINY_N

    def apply(self, *, speed_mps: Array, accel_mps2: Array, friction: Array) -> None:
        """Set the forces of the next control tick from body speed, command, friction, each (S,).

        Forces along the road are divided by the effective mass factor instead of adding wheel
        inertia to the chassis, which would add it sideways too.
        """
        ids, mass = self._ids, self._mass
        command = np.minimum(np.maximum(accel_mps2, -self._max_brake), self._max_drive)
        grip = friction * GRAVITY_MPS2
        accel = command * np.where(command > 0.0, self._drive_gain, self._brake_gain)
        accel = np.minimum(np.maximum(accel, -grip), grip)
        share = np.sqrt(np.maximum(1.0 - np.square(accel / grip), _MIN_LATERAL_SHARE**2))
        shift = self._transfer * accel
        front_load = np.maximum(self._front_load - shift, 0.0) + _TINY_N
        rear_load = np.maximum(self._rear_load + shift, 0.0) + _TINY_N
        slow = np.maximum(np.abs(speed_mps), _MIN_SPEED_MPS)
        self._biasprm[:, ids.tyre_front, 2] = -self._front_stiffness * front_load / slow
        self._biasprm[:, ids.tyre_rear, 2] = -self._rear_stiffness * rear_load / slow
        lateral = friction * share
        self._limit(ids.tyre_front, lateral * front_load)
        self._limit(ids.tyre_rear, lateral * rear_load)
        self._limit(ids.brake, mass * np.maximum(-accel, 0.0) + self._rolling)
        self._ctrl[:, ids.drive] = mass * np.maximum(accel, 0.0) - self._drag * speed_mps * np.abs(
            speed_mps
        )

    def _limit(self, actuator: int, force_n: Array) -> None:
        self._forcerange[:, actuator, 0] = -force_n
        self._forcerange[:, actuator, 1] = force_n


def resistance_mps2(vehicle: VehicleParameters, speed_mps: Array) -> Array:
    """Return the deceleration by drag and rolling at `speed_mps`, for a command to undo."""
    speed = np.abs(speed_mps)
    force = vehicle.drag_npv2.value * speed * speed_mps
    force += (speed > 0.1) * np.sign(speed_mps) * vehicle.rolling_resistance_n.value
    return np.asarray(force / vehicle.mass_kg.value)
