"""Vehicles as others meet them: road users, reckoned to one instant and for how long that holds."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from foretwin.contracts.drive import OthersAround, RoadUser, RoadUsers, VehicleState
from foretwin.contracts.vehicle import VehicleParameters, kind_by_length
from foretwin.orchestrator.other_vehicles.dead_reckoning import reckoned, reckoned_for_s
from foretwin.orchestrator.other_vehicles.detected import moved_ahead
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m


class Measured(NamedTuple):
    """What was measured last of a vehicle, by the car's clock, and its parameters."""

    state: VehicleState
    vehicle: VehicleParameters


def road_user(state: VehicleState, vehicle: VehicleParameters) -> RoadUser:
    """Return a vehicle as the road user that others meet."""
    length_m = vehicle.length_m.value
    ahead_m = box_centre_from_base_m(vehicle)
    return RoadUser(
        user_id=state.vehicle_id,
        kind=kind_by_length(length_m),
        position=moved_ahead(state.position, state.yaw_rad, ahead_m),
        yaw_rad=state.yaw_rad,
        speed_mps=state.speed_mps,
        length_m=length_m,
        width_m=vehicle.width_m.value,
    )


def surroundings(others: Iterable[Measured], *, stamp_ns: int, later_ns: int) -> OthersAround:
    """Return where the others are reckoned to be at `stamp_ns` of the car's clock.

    It goes to a vehicle to whose stamps `later_ns` is added for the car's, and is stamped by its.
    Who is not known to a metre any more is left out.
    """
    left = [
        (one, reckoned_for_s(one.vehicle) - max(0, stamp_ns - one.state.stamp_ns) / 1e9)
        for one in others
    ]
    known = [(one, left_s) for one, left_s in left if left_s > 0.0]
    users = (road_user(reckoned(one.state, stamp_ns), one.vehicle) for one, _ in known)
    return OthersAround(
        users=RoadUsers(
            stamp_ns=stamp_ns - later_ns,
            users=tuple(msgspec.structs.replace(user, virtual=True) for user in users),
        ),
        known_for_s=tuple(left_s for _, left_s in known),
    )
