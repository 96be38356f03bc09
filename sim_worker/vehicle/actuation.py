"""From commanded acceleration to forces: gains, resistances, load transfer, the friction limit.

Vectorised over S simulations; the arrays it writes are those of a Batch, or of one model with a
leading axis of 1.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.vehicle import compiled
from foretwin.sim_worker.vehicle.lag import ForceLag, lags_of_force
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2
from foretwin.sim_worker.vehicle.planar import DRIVE, STEER, TYRE_FRONT, TYRE_REAR

_MIN_SPEED_MPS = 1.0
"""Below it tyres act as dampers: slip angles lose their meaning towards standstill."""
_MIN_LATERAL_SHARE = 0.2
"""Of the friction limit, left to lateral force under full braking: a real ABS leaves that much."""
_TINY_N, _TINY_KG = 1e-9, 1e-9
"""A force range of exactly 0 would mean unlimited."""
_STANDS_MPS = 0.05
"""Below it, brakes that are strong enough hold a car on a slope instead of slowing it down."""


class ActuatorIds(NamedTuple):
    """Indices of the vehicle's actuators in a compiled model."""

    tyre_front: int
    tyre_rear: int
    drive: int
    steer: int


def actuator_ids(model: mujoco.MjModel, prefix: str) -> ActuatorIds:
    """Find the actuators of the vehicle attached under `prefix`; KeyError where there is none."""
    names = (TYRE_FRONT, TYRE_REAR, DRIVE, STEER)
    return ActuatorIds(*(model.actuator(prefix + name).id for name in names))


class Actuation:
    """Writes tyre stiffness, force limits and drive force of S vehicles at each control tick.

    `ctrl` (S, nu) or for every step (S, steps, nu), `biasprm` (S, nu, k) and `forcerange`
    (S, nu, 2) are written in place; `friction` (S,) stays. The actuator along the road is a brake,
    a strong damper within ± its force, shifted by the drive force: at speed drive minus brake, at
    standstill a hold. With `tick_s`, the time between two calls of `apply`, forces lag as the
    vehicle's parameters say, from `accel_mps2` (S,) on; without, they are immediate. Where
    `backwards` (S,) is true, the gear is in reverse: commands count in that direction.
    """

    def __init__(
        self,
        vehicle: VehicleParameters,
        ids: ActuatorIds,
        *,
        friction: Array,
        ctrl: Array,
        biasprm: Array,
        forcerange: Array,
        tick_s: float | None = None,
        accel_mps2: Array | None = None,
        backwards: Flags | None = None,
    ) -> None:
        tyres = slice(ids.tyre_front, ids.tyre_rear + 1)
        if ids.tyre_rear != ids.tyre_front + 1:
            raise ValueError(f"the tyres' actuators must follow each other: {ids}")
        self._drive_n = ctrl[..., ids.drive].T
        self._damping = biasprm[:, tyres, 2].T
        self._lateral_low = forcerange[:, tyres, 0].T
        self._lateral_high = forcerange[:, tyres, 1].T
        self._along_low, self._along_high = forcerange[:, ids.drive].T
        mass = vehicle.mass_kg.value
        wheelbase = vehicle.wheelbase_m.value
        rear = vehicle.cog_from_rear_axle_m.value
        axles = mass / wheelbase * np.array([[rear], [wheelbase - rear]])
        transfer = mass * vehicle.cog_height_m.value / (wheelbase * GRAVITY_MPS2)
        stiffness = np.array(
            [
                [vehicle.front_cornering_stiffness_npr.value],
                [vehicle.rear_cornering_stiffness_npr.value],
            ]
        )
        # All as wide as what they meet: numpy takes twice as long to spread a column.
        count = len(friction)
        self._axles_kg = np.repeat(axles, count, axis=1)
        self._transfer_kgpmps2 = np.repeat([[-transfer], [transfer]], count, axis=1)
        self._stiffness_prkg = np.repeat(-stiffness / axles, count, axis=1)
        effective = vehicle.wheel_inertia_mass_factor.value
        self._drive_gain = vehicle.drive_gain.value / effective
        self._brake_gain = vehicle.brake_gain.value / effective
        self._max_drive = vehicle.max_drive_accel_mps2.value
        self._max_brake = vehicle.max_brake_decel_mps2.value
        drag = vehicle.drag_npv2.value / effective
        self._pulled_kg = mass / effective
        rolling = vehicle.rolling_resistance_n.value / effective + _TINY_N
        self._constants = tuple(map(float, (mass, rolling, drag, _TINY_KG, _MIN_SPEED_MPS)))
        self._friction = np.array(friction, dtype=np.float64)
        self._gear: Array | None = None
        if backwards is not None and backwards.any():
            self._gear = np.where(backwards, -1.0, 1.0)
        self._ways = np.ones(count) if self._gear is None else self._gear
        self._lag: ForceLag | None = None
        if tick_s is not None and lags_of_force(vehicle):
            start = np.zeros(count) if accel_mps2 is None else accel_mps2
            self._lag = ForceLag(vehicle, tick_s=tick_s, accel_mps2=start)
        self._limit()

    def _limit(self) -> None:
        """Bound what tyres bear along the road, and what they keep across it."""
        grip = self._friction * GRAVITY_MPS2
        self._most, self._least = grip, -grip
        if self._lag is None:
            # What drive and brakes can do goes together with it.
            self._most = np.minimum(grip, self._max_drive * self._drive_gain)
            self._least = np.maximum(-grip, -self._max_brake * self._brake_gain)
        self._grip_square = np.square(grip)
        self._least_square = self._grip_square * _MIN_LATERAL_SHARE**2

    def restart(self, rows: Indices, *, friction: Array, accel_mps2: Array) -> None:
        """Let the vehicles of `rows` (K,) begin anew with `accel_mps2` (K,) on `friction` (K,)."""
        self._friction[rows] = friction
        self._limit()
        if self._lag is not None:
            self._lag.restart(rows, accel_mps2)

    def apply(
        self, *, speed_mps: Array, accel_mps2: Array, climb_mps2: Array | None = None
    ) -> None:
        """Set the forces of the next control tick from body speed and command, each (S,).

        `climb_mps2` (S,) is the deceleration by a slope, where there is one. Forces along the road
        are divided by the effective mass factor instead of adding wheel inertia to the chassis,
        which would add it sideways too.
        """
        accel = self._carried_out(np.asarray(accel_mps2, dtype=np.float64))
        compiled.forces(
            accel,
            speed_mps,
            self._grip_square,
            self._least_square,
            self._transfer_kgpmps2,
            self._axles_kg,
            self._stiffness_prkg,
            self._constants,
            self._ways,
            self._damping,
            self._lateral_low,
            self._lateral_high,
            np.atleast_2d(self._drive_n),
            self._along_low,
            self._along_high,
        )
        if climb_mps2 is not None:
            self._pull(speed_mps, climb_mps2)

    def _pull(self, speed_mps: Array, climb_mps2: Array) -> None:
        """Let a slope pull, with the wheels' inertia to move as well; what is held stays."""
        pull = -self._pulled_kg * climb_mps2
        low, high = self._along_low + pull, self._along_high + pull
        held = (np.abs(speed_mps) < _STANDS_MPS) & (low <= 0.0) & (high >= 0.0)
        brake = (high - low) / 2.0
        self._along_low[:] = np.where(held, -brake, low)
        self._along_high[:] = np.where(held, brake, high)
        self._drive_n[:] = np.where(held, 0.0, self._drive_n + pull)

    def _carried_out(self, command_mps2: Array) -> Array:
        """Return the acceleration (S,) by the tyres that a command leads to now."""
        if self._lag is not None:
            command = np.minimum(np.maximum(command_mps2, -self._max_brake), self._max_drive)
            drive, brake = self._lag.follow(command)
            accel = drive * self._drive_gain + brake * self._brake_gain
        elif self._drive_gain == self._brake_gain:
            accel = command_mps2 * self._drive_gain
        else:
            gain = np.where(command_mps2 > 0.0, self._drive_gain, self._brake_gain)
            accel = command_mps2 * gain
        np.maximum(accel, self._least, out=accel)
        return np.minimum(accel, self._most, out=accel)
