"""A vehicle beside the car of which only the car's own detections tell."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.drive import RoadUser, RoadUsers, VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, wrap_angle
from foretwin.contracts.roles import OtherVehicle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.other_vehicles.measured import OtherVehicleSource
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m


class DetectedVehicle(OtherVehicleSource):
    """Who the car itself detects under one id."""

    def __init__(self, vehicle_id: str, seen_as: str, vehicle: VehicleParameters) -> None:
        super().__init__()
        self._id, self._seen_as = vehicle_id, seen_as
        self._ahead_m = box_centre_from_base_m(vehicle)
        self._last: VehicleState | None = None

    def take(self, users: RoadUsers) -> None:
        """Take what the car detected."""
        for user in users.users:
            if user.user_id == self._seen_as:
                self._take(user, users.stamp_ns)

    def _take(self, user: RoadUser, stamp_ns: int) -> None:
        last = self._last
        rate_radps = 0.0
        if last is not None:
            passed_s = (stamp_ns - last.stamp_ns) / 1e9
            if passed_s <= 0.0:
                return
            if passed_s < 1.0:
                rate_radps = float(wrap_angle(user.yaw_rad - last.yaw_rad)) / passed_s
        state = VehicleState(
            vehicle_id=self._id,
            stamp_ns=stamp_ns,
            position=moved_ahead(user.position, user.yaw_rad, -self._ahead_m),
            yaw_rad=user.yaw_rad,
            speed_mps=user.speed_mps,
            yaw_rate_radps=rate_radps,
            accel_mps2=0.0,
            estimated=("yaw_rate_radps", "accel_mps2"),
        )
        self._last = state
        self._heard.append(OtherVehicle(state=state))


def moved_ahead(position: GeoPoint, yaw_rad: float, ahead_m: float) -> GeoPoint:
    """Return a position moved along a yaw from true east; near it, grids do not matter."""
    here = LocalFrame(position)
    lat, lon = geo_from_local(here, ahead_m * np.array([np.cos(yaw_rad), np.sin(yaw_rad)]))
    return GeoPoint(float(lat), float(lon))
