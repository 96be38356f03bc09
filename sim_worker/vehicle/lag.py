"""Drive and brake follow their command late: a dead time, then a first-order lag each."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.vehicle import Parameter, VehicleParameters


class ForceLag:
    """What drive and brakes of S vehicles exert, tick by tick, of what they were told to.

    Commands change once a tick. Within one, the mean of the exponential is what acts, so that
    speeds after a tick are exact; dead times need not be whole ticks.
    """

    def __init__(self, vehicle: VehicleParameters, *, tick_s: float, accel_mps2: Array) -> None:
        """Start with `accel_mps2` (S,) acting, and commanded all along."""
        lags = (vehicle.drive_lag_s.value, vehicle.brake_lag_s.value)
        decays = [math.exp(-tick_s / lag) if lag > 0.0 else 0.0 for lag in lags]
        self._decay = np.array(decays)[:, None]
        self._mean = np.array([lag / tick_s * (1 - d) for lag, d in zip(lags, decays, strict=True)])
        self._mean = self._mean[:, None]
        late = vehicle.accel_delay_s.value / tick_s
        self._whole = math.floor(late + 1e-9)
        self._part = max(late - self._whole, 0.0)
        start = np.asarray(accel_mps2, dtype=np.float64)
        self._acting = np.stack([np.maximum(start, 0.0), np.minimum(start, 0.0)])
        self._commands = [start] * (self._whole + 2)

    def restart(self, rows: Indices, accel_mps2: Array) -> None:
        """Let some begin anew with `accel_mps2` (K,) acting."""
        self._acting[:, rows] = np.maximum(accel_mps2, 0.0), np.minimum(accel_mps2, 0.0)
        self._commands = [command.copy() for command in self._commands]
        for command in self._commands:
            command[rows] = accel_mps2

    def follow(self, command_mps2: Array) -> tuple[Array, Array]:
        """Return what drive (≥ 0) and brakes (≤ 0) exert over the next tick, each (S,)."""
        self._commands = [command_mps2.copy(), *self._commands[:-1]]
        newer, older = self._commands[self._whole : self._whole + 2]
        due = newer if self._part == 0.0 else newer + self._part * (older - newer)
        wanted = np.empty_like(self._acting)
        np.maximum(due, 0.0, out=wanted[0])
        np.minimum(due, 0.0, out=wanted[1])
        behind = self._acting - wanted
        self._acting = wanted + self._decay * behind
        drive, brake = wanted + self._mean * behind
        return drive, brake


def lags_of_force(vehicle: VehicleParameters) -> bool:
    """Whether drive or brakes of `vehicle` are anything but immediate."""
    late = (vehicle.drive_lag_s, vehicle.brake_lag_s, vehicle.accel_delay_s)
    return any(parameter.value > 0.0 for parameter in late)


def without_lags(vehicle: VehicleParameters) -> VehicleParameters:
    """Return `vehicle` with actuators that follow at once, but for the delay of the steering.

    For commands that were estimated from the motion: these have the lags in them already.
    """
    none = Parameter(0.0, None, "commands estimated from the motion have the lags in them")
    return msgspec.structs.replace(
        vehicle, drive_lag_s=none, brake_lag_s=none, accel_delay_s=none, steering_lag_s=none
    )
