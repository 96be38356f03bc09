"""A car's reference points: base_link, its centre of gravity, and the centre of its box.

Free of MuJoCo, so that planners, metrics and whoever only compares poses need none of it.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters


def box_centre_from_base_m(vehicle: VehicleParameters) -> float:
    """Return how far the centre of the vehicle's box lies ahead of base_link."""
    return vehicle.length_m.value / 2.0 - vehicle.rear_overhang_m.value


def front_from_base_m(vehicle: VehicleParameters) -> float:
    """Return how far the front bumper lies ahead of base_link."""
    return vehicle.length_m.value - vehicle.rear_overhang_m.value


def cog_from_base(vehicle: VehicleParameters, states: Array) -> tuple[Array, Array]:
    """Return joint positions (S, 4) and velocities (S, 4) of base_link `states` (S, 8).

    x, y, yaw of the centre of gravity and the tyre angle; velocities in the world frame.
    """
    rear = vehicle.cog_from_rear_axle_m.value
    cos, sin = np.cos(states[:, 2]), np.sin(states[:, 2])
    u, r = states[:, 3], states[:, 5]
    v = states[:, 4] + rear * r
    positions = np.stack(
        [states[:, 0] + rear * cos, states[:, 1] + rear * sin, states[:, 2], states[:, 6]], axis=1
    )
    velocities = np.stack([cos * u - sin * v, sin * u + cos * v, r, np.zeros_like(r)], axis=1)
    return positions, velocities


def base_from_cog(
    vehicle: VehicleParameters, positions: Array, velocities: Array, out: Array
) -> Array:
    """Fill columns 0 to 6 of base_link states `out` (S, 8) from joints (S, 4); returns `out`."""
    rear = vehicle.cog_from_rear_axle_m.value
    columns, place, motion = out.T, positions.T, velocities.T
    ahead = np.array([np.cos(place[2]), np.sin(place[2])])
    columns[:2] = place[:2] - rear * ahead
    columns[2:7:4] = place[2:]
    columns[3] = np.add(*(ahead * motion[:2]))
    across = ahead[::-1] * motion[:2]
    columns[4] = across[1] - across[0] - rear * motion[2]
    columns[5] = motion[2]
    return out
