"""The car's actuators, the same for every engine: dead times, lags, gains and limits.

The twin in MuJoCo has the same ones in `vehicle.actuation` and in its steering actuator.
"""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.engines.engine import Demand
from foretwin.sim_worker.vehicle import compiled
from foretwin.sim_worker.vehicle.lag import ForceLag
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2
from foretwin.sim_worker.vehicle.planar import LEAST_STEERING_LAG_S, MAX_STEERING_DELAY_S
from foretwin.sim_worker.vehicle.timestep import TIMESTEP_S

_KEPT = math.ceil(MAX_STEERING_DELAY_S / TIMESTEP_S) + 2
"""Commands before the present tick that a delay may ask for."""


class Actuators:
    """Turns the commands of S cars, tick by tick, into what acts on their wheels."""

    def __init__(
        self,
        vehicle: VehicleParameters,
        *,
        states: Array,
        friction: Array,
        steering_delay_s: Array,
        backwards: Flags,
        steps: int,
    ) -> None:
        """Begin with the angles and accelerations of `states` (S, 8), commanded all along."""
        self._vehicle, self._steps = vehicle, steps
        angle = np.array(states[:, 6])
        self._angle, self._command = angle.copy(), angle.copy()
        self._past = np.repeat(angle[None], _KEPT + steps, axis=0)
        self._delay_s = np.array(steering_delay_s, dtype=np.float64)
        self._grip = GRAVITY_MPS2 * np.array(friction, dtype=np.float64)
        self._gear = np.where(backwards, -1.0, 1.0)
        self._lag = ForceLag(vehicle, tick_s=steps * TIMESTEP_S, accel_mps2=states[:, 7])

    def restart(
        self, rows: Indices, *, states: Array, friction: Array, steering_delay_s: Array
    ) -> None:
        """Let the cars `rows` (K,) begin anew."""
        self._angle[rows] = self._command[rows] = self._past[:, rows] = states[:, 6]
        self._delay_s[rows], self._grip[rows] = steering_delay_s, GRAVITY_MPS2 * friction
        self._lag.restart(rows, states[:, 7])

    def follow(self, accel_mps2: Array, tire_angle_rad: Array, climb_mps2: Array | None) -> Demand:
        """Return what acts during the coming tick where this is commanded, each (S,)."""
        car = self._vehicle
        most, least = car.max_drive_accel_mps2.value, -car.max_brake_decel_mps2.value
        drive, brake = self._lag.follow(np.clip(accel_mps2, least, most))
        # A driver's slip control: wheels are asked for no more than the road can hold.
        drive = np.minimum(drive * car.drive_gain.value, self._grip)
        brake = np.minimum(-brake * car.brake_gain.value, self._grip)
        climb = np.zeros(len(drive)) if climb_mps2 is None else np.array(climb_mps2)
        return Demand(drive * self._gear, brake, climb, self._steered(tire_angle_rad))

    def _steered(self, wanted_rad: Array) -> Array:
        car, count = self._vehicle, len(self._angle)
        commanded, angles = np.empty((self._steps, count)), np.empty((self._steps, count))
        rate = car.max_tire_rate_radps.value * TIMESTEP_S
        compiled.ramp(np.array(wanted_rad, dtype=np.float64), self._command, rate, commanded)
        self._past = np.concatenate([self._past[self._steps :], commanded])
        lag_s = max(car.steering_lag_s.value, LEAST_STEERING_LAG_S)
        share, limit = 1.0 - math.exp(-TIMESTEP_S / lag_s), car.max_tire_angle_rad.value
        late, cars = self._delay_s / TIMESTEP_S, np.arange(count)
        whole = np.floor(late + 1e-9).astype(int)
        part = np.maximum(late - whole, 0.0)
        for step in range(self._steps):
            now = _KEPT + step
            newer, older = self._past[now - whole, cars], self._past[now - whole - 1, cars]
            due = np.clip(newer + part * (older - newer), -limit, limit)
            self._angle = self._angle + share * (due - self._angle)
            angles[step] = self._angle
        return angles
