"""What slows a rolling vehicle down."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters


def resistance_mps2(
    vehicle: VehicleParameters, speed_mps: Array, climb_mps2: Array | None = None
) -> Array:
    """Return the deceleration by drag and rolling at `speed_mps`, for a command to undo.

    `climb_mps2` (S,) is that by the slope, where there is one.
    """
    level = _level_mps2(vehicle, speed_mps)
    return level if climb_mps2 is None else level + climb_mps2


def _level_mps2(vehicle: VehicleParameters, speed_mps: Array) -> Array:
    mass, rolling = vehicle.mass_kg.value, vehicle.rolling_resistance_n.value
    drag = vehicle.drag_npv2.value
    if drag == rolling == 0.0:
        return np.zeros(np.shape(speed_mps))
    speed = np.abs(speed_mps)
    decel = drag / mass * speed
    decel *= speed_mps
    if rolling > 0.0:
        decel += (speed > 0.1) * np.sign(speed_mps) * (rolling / mass)
    return decel
