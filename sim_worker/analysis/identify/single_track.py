"""What a single-track car's yaw rate and speed say of its sideways motion.

Sideways acceleration is v r only as long as the car does not begin or end to slide sideways: on the
way into a bend it differs by a tenth. Slips follow from the forces that the axles must bear, and
those from the acceleration, so that two rounds are enough (Gillespie 1992, chapter 6).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters

SLOWEST_MPS = 2.0
"""Below it, slips are lost in noise."""


class Sideways(NamedTuple):
    """A car's sideways motion at N instants, of its centre of gravity, positive to the left."""

    accel_mps2: Array
    speed_mps: Array
    rear_slip_rad: Array
    front_mps2: Array
    """The front axle's force over the car's mass."""


def sideways(
    vehicle: VehicleParameters,
    *,
    speed_mps: Array,
    yaw_rate_radps: Array,
    yaw_accel_radps2: Array,
    period_s: float,
) -> Sideways:
    """Return the sideways motion (N,) of the file's car that turns so; NaN where that is NaN."""
    base, rear = vehicle.wheelbase_m.value, vehicle.cog_from_rear_axle_m.value
    mass, stiffness = vehicle.mass_kg.value, vehicle.rear_cornering_stiffness_npr.value
    fast = np.maximum(speed_mps, SLOWEST_MPS)
    turning = vehicle.yaw_inertia_kgm2.value / mass * yaw_accel_radps2
    accel = speed_mps * yaw_rate_radps
    slip = speed = np.zeros_like(accel)
    for _ in range(2):
        slip = ((base - rear) * accel - turning) / base * mass / stiffness
        speed = rear * yaw_rate_radps - fast * slip
        accel = speed_mps * yaw_rate_radps + np.gradient(speed, period_s)
    return Sideways(accel, speed, slip, (rear * accel + turning) / base)
