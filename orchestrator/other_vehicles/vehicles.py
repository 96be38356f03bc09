"""Vehicles beside the car: from a log, the bus or the car's own detections to states in its time.

Nothing is taken that is later than the car's own newest state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.bus import Received
from foretwin.contracts.drive import InfoRequest, RoadUser, RoadUsers, VehicleInfo, VehicleState
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.roles import OtherVehicles, Role
from foretwin.contracts.vehicle import VehicleParameters, kind_by_length
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.instructions import LatestReports
from foretwin.orchestrator.other_vehicles.detected import DetectedVehicle, moved_ahead
from foretwin.orchestrator.other_vehicles.live import LiveVehicle
from foretwin.orchestrator.other_vehicles.measured import FRESH_NS, OtherVehicleSource
from foretwin.orchestrator.other_vehicles.recorded import RecordedVehicle
from foretwin.orchestrator.plan import OtherVehiclePlan
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

SAME_WITHIN_M = 2.0
"""A detection whose centre is so near to that of a vehicle with telemetry of its own is it."""


def road_user(state: VehicleState, vehicle: VehicleParameters) -> RoadUser:
    """Return a vehicle as the road user that futures meet."""
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


class OtherVehicleFeed:
    """All vehicles beside the car: passes their states on, and shows them to futures."""

    def __init__(self, context: DriveContext) -> None:
        """What a vehicle says of itself when it is asked lands in the mailbox, for `take_info`."""
        plan = context.plan
        self._context, self._crew, self._frame = context, plan.beside, plan.drive_frame
        self._sources: dict[str, OtherVehicleSource] = {}
        self._vehicles = {one.config.id: one.vehicle for one in plan.beside}
        self._seen_as = {one.config.seen_as for one in plan.beside}
        self._latest: dict[str, VehicleState] = {}
        self._detected_ns: int | None = None

    def begin(self, own: VehicleInfo) -> None:
        """Open what there is, now that the car's clock is known."""
        self._sources = {one.config.id: self._source(one, own) for one in self._crew}

    def close(self) -> None:
        """Let go of files and threads; idempotent."""
        for source in self._sources.values():
            source.close()

    def _source(self, beside: OtherVehiclePlan, own: VehicleInfo) -> OtherVehicleSource:
        config, vehicle = beside.config, beside.vehicle
        if config.log is not None:
            return RecordedVehicle(
                Path(config.log),
                config.id,
                vehicle,
                own=own,
                offset_s=config.log_offset_s,
                waits=self._context.plan.config.lock_step,
                tell=self._context.tell,
            )
        if config.seen_as is not None:
            return DetectedVehicle(config.id, config.seen_as, vehicle)
        return LiveVehicle(config.id, vehicle, ask_info=self._ask_info, tell=self._context.tell)

    def _ask_info(self, vehicle_id: str) -> None:
        bus, mailbox = self._context.bus, self._context.mailbox
        bus.request("info", InfoRequest(), mailbox, tag=vehicle_id, vehicle=vehicle_id)

    def take_sample(self, vehicle_id: str, item: Received) -> None:
        """Take a sample of a vehicle on the bus; raises Refused for what the guard keeps out."""
        item.message()
        source = self._sources.get(vehicle_id)
        if isinstance(source, LiveVehicle):
            source.take(item)

    def take_info(self, vehicle_id: str, info: VehicleInfo | None) -> None:
        """Take what a vehicle on the bus says of itself, None where it does not answer."""
        source = self._sources.get(vehicle_id)
        if isinstance(source, LiveVehicle):
            source.take_info(info)

    def keep_up_with(self, own: VehicleState, detected: RoadUsers | None) -> None:
        """Pass on everything up to the car's own new state; `detected` is what it saw last."""
        if not self._sources:
            return
        if detected is not None and detected.stamp_ns != self._detected_ns:
            self._detected_ns = detected.stamp_ns
            for source in self._sources.values():
                if isinstance(source, DetectedVehicle):
                    source.take(detected)
        heard = [one for s in self._sources.values() for one in s.states_until(own)]
        heard.sort(key=lambda one: (one.state.stamp_ns, one.state.vehicle_id))
        self._latest |= {one.state.vehicle_id: one.state for one in heard}
        message = OtherVehicles(stamp_ns=own.stamp_ns, heard=tuple(heard))
        self._context.publish("other_vehicles", message)

    def among(
        self, reports: LatestReports, own: VehicleState, roles: Mapping[str, Role]
    ) -> LatestReports:
        """Return what surrounds the car with these vehicles in it, ghosts excepted."""
        if not self._sources:
            return reports
        mine = [
            road_user(state, self._vehicles[name])
            for name, state in self._latest.items()
            if roles.get(name) in ("twin", "shadow")
            and abs(own.stamp_ns - state.stamp_ns) <= FRESH_NS
        ]
        users = reports.road_users
        fresh = users is not None and abs(own.stamp_ns - users.stamp_ns) <= FRESH_NS
        seen = users.users if fresh and users is not None else ()
        same = self._same(seen, mine)
        detected = [
            user
            for user, is_mine in zip(seen, same.tolist(), strict=True)
            if user.user_id not in self._seen_as and not is_mine
        ]
        return reports._replace(
            road_users=RoadUsers(stamp_ns=own.stamp_ns, users=(*detected, *mine))
        )

    def _same(self, seen: Sequence[RoadUser], mine: Sequence[RoadUser]) -> Flags:
        """Return which of those that were seen are vehicles that are known anyway, (N,)."""
        apart = self._places(seen)[:, None] - self._places(mine)
        same = np.hypot(apart[..., 0], apart[..., 1]) < SAME_WITHIN_M
        return np.asarray(same.any(axis=1))

    def _places(self, users: Sequence[RoadUser]) -> Array:
        positions = [(user.position.lat_deg, user.position.lon_deg) for user in users]
        return local_from_geo(self._frame, *np.array(positions).reshape(-1, 2).T)
