"""Road users that the car detected, as members of its futures."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.drive import RoadUsers, VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.futures import SeenRoadUser

_FRESH_NS = 500_000_000
WITHIN_M = 120.0
"""Of the car: who is farther away does not meet it within a horizon."""


def near_car(
    users: RoadUsers | None, state: VehicleState, frame: LocalFrame
) -> tuple[SeenRoadUser, ...]:
    """Return the road users seen at about the state's time, in the World's frame."""
    if users is None or abs(state.stamp_ns - users.stamp_ns) > _FRESH_NS:
        return ()
    here = local_from_geo(frame, state.position.lat_deg, state.position.lon_deg)
    seen = {}  # by id: nobody is there twice
    for user in users.users:
        lat, lon = user.position.lat_deg, user.position.lon_deg
        xy = local_from_geo(frame, lat, lon)
        if float(np.hypot(*(xy - here))) > WITHIN_M:
            continue
        seen[user.user_id] = SeenRoadUser(
            user_id=user.user_id,
            kind=user.kind,
            x_m=float(xy[0]),
            y_m=float(xy[1]),
            yaw_rad=float(local_from_geo_yaw(frame, user.yaw_rad, lat, lon)),
            speed_mps=user.speed_mps,
            length_m=user.length_m,
            width_m=user.width_m,
        )
    return tuple(seen.values())
