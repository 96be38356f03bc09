"""What slows a rolling vehicle down."""

from __future__ import annotations

import numpy as np

from contracts.arrays import Array
from contracts.vehicle import VehicleParameters


def resistance_mps2(vehicle: VehicleParameters, speed_mps: Array) -> Array:
    """Return the deceleration by drag and rolling at `speed_mps`, for a command to undo."""
    speed = np.abs(speed_mps)
    force = vehicle.drag_npv2.value * speed * speed_mps
    force += (speed > 0.1) * np.sign(speed_mps) * vehicle.rolling_resistance_n.value
    return np.asarray(force / vehicle.mass_kg.value)
