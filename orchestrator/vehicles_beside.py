"""Vehicles beside the car: from a log, the bus or the car's own detections to states in its time.

Nothing is taken that is later than the car's own newest state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec
import numpy as np

from contracts.bus import Received
from contracts.codec import SchemaMismatch
from contracts.drive import (
    ControlCommand,
    RoadUser,
    RoadUsers,
    VehicleInfo,
    VehicleState,
)
from contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_from_geo, wrap_angle
from contracts.roles import OtherVehicle, OtherVehicles, Role
from contracts.vehicle import VehicleParameters, kind_by_length
from orchestrator.intake import Surroundings
from orchestrator.plan import Beside, DrivePlan
from sim_worker.vehicle.planar import box_centre_from_base_m
from telemetry.estimator import StateEstimator
from telemetry.logs import open_log
from telemetry.replay import ReplaySource

PERIOD_NS = 18_000_000
"""Between two states of a vehicle that are passed on: 50 Hz at most."""
FRESH_NS = 500_000_000
SAME_WITHIN_M = 2.0
"""A detection whose centre is so near to that of a vehicle with telemetry of its own is it."""


def estimator_of(info: VehicleInfo, vehicle: VehicleParameters) -> StateEstimator:
    """Return the estimator of a vehicle's state."""
    return StateEstimator(
        info,
        wheelbase_m=vehicle.wheelbase_m.value,
        steering_ratio=vehicle.steering_ratio.value,
        steering_offset_rad=vehicle.steering_offset_rad.value,
    )


class _Measured:
    """Samples of one vehicle to states, as far apart as is worth passing on."""

    def __init__(self, vehicle_id: str, estimator: StateEstimator) -> None:
        self._id, self._estimator = vehicle_id, estimator
        self._commands: list[ControlCommand] = []
        self._last_ns: int | None = None

    def take(
        self, channel: str, message: msgspec.Struct, *, later_ns: int = 0
    ) -> OtherVehicle | None:
        """Take one sample; `later_ns` is added to its stamp once the state is estimated."""
        if isinstance(message, ControlCommand):
            stamp_ns = message.stamp_ns + later_ns
            self._commands.append(msgspec.structs.replace(message, stamp_ns=stamp_ns))
        state = self._estimator.handle(channel, message)
        if state is None or not state.yaw_valid:
            return None
        stamp_ns = state.stamp_ns + later_ns
        if self._last_ns is not None and stamp_ns - self._last_ns < PERIOD_NS:
            return None
        commands, self._commands = tuple(self._commands), []
        self._last_ns = stamp_ns
        moved = msgspec.structs.replace(state, stamp_ns=stamp_ns, vehicle_id=self._id)
        return OtherVehicle(state=moved, commands=commands)


class LogBeside:
    """A recorded drive, read as far as the car's own time has come.

    Two logs on UTC keep their stamps; otherwise both begin together. `offset_s` says how much of
    this log has passed as the car's drive begins.
    """

    def __init__(
        self,
        file: Path,
        vehicle_id: str,
        vehicle: VehicleParameters,
        *,
        own: VehicleInfo,
        offset_s: float | None,
    ) -> None:
        log = open_log(file)
        self._source = ReplaySource(log, vehicle_id=vehicle_id)
        info = self._source.info
        self._measured = _Measured(vehicle_id, estimator_of(info, vehicle))
        same_clock = info.time_base == own.time_base == "utc"
        if offset_s is None and same_clock:
            self._later_ns = 0
        else:
            log_ns = info.start_stamp_ns + round((offset_s or 0.0) * 1e9)
            self._later_ns = own.start_stamp_ns - log_ns

    def states_until(self, own: VehicleState) -> list[OtherVehicle]:
        """Return the states up to the car's own."""
        heard = (
            self._measured.take(channel, message, later_ns=self._later_ns)
            for channel, message in self._source.advance(own.stamp_ns - self._later_ns)
        )
        return [one for one in heard if one is not None]


class LiveBeside:
    """A vehicle that publishes on the bus by the car's own clock."""

    def __init__(self, vehicle_id: str, vehicle: VehicleParameters) -> None:
        self._id, self._vehicle = vehicle_id, vehicle
        self._measured: _Measured | None = None
        self._heard: list[OtherVehicle] = []

    def take(self, item: Received) -> None:
        """Take a sample from the bus; one of another schema is passed over."""
        try:
            message = item.message()
        except SchemaMismatch:
            return
        if self._measured is None:
            info = VehicleInfo(
                vehicle_id=self._id, time_base="utc", start_stamp_ns=message.stamp_ns
            )
            self._measured = _Measured(self._id, estimator_of(info, self._vehicle))
        heard = self._measured.take(item.channel, message)
        if heard is not None:
            self._heard.append(heard)

    def states_until(self, own: VehicleState) -> list[OtherVehicle]:
        """Return what has come since the last time."""
        heard, self._heard = self._heard, []
        return heard


class DetectedBeside:
    """Who the car itself detects under one id."""

    def __init__(self, vehicle_id: str, seen_as: str, vehicle: VehicleParameters) -> None:
        self._id, self._seen_as = vehicle_id, seen_as
        self._ahead_m = box_centre_from_base_m(vehicle)
        self._last: VehicleState | None = None
        self._heard: list[OtherVehicle] = []

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
            position=_moved(user.position, user.yaw_rad, -self._ahead_m),
            yaw_rad=user.yaw_rad,
            speed_mps=user.speed_mps,
            yaw_rate_radps=rate_radps,
            accel_mps2=0.0,
            estimated=("yaw_rate_radps", "accel_mps2"),
        )
        self._last = state
        self._heard.append(OtherVehicle(state=state))

    def states_until(self, own: VehicleState) -> list[OtherVehicle]:
        """Return what has been detected since the last time."""
        heard, self._heard = self._heard, []
        return heard


def _moved(position: GeoPoint, yaw_rad: float, ahead_m: float) -> GeoPoint:
    """Return a position moved along a yaw from true east; near it, grids do not matter."""
    here = LocalFrame(position)
    lat, lon = geo_from_local(here, ahead_m * np.array([np.cos(yaw_rad), np.sin(yaw_rad)]))
    return GeoPoint(float(lat), float(lon))


def road_user(state: VehicleState, vehicle: VehicleParameters) -> RoadUser:
    """Return a vehicle as the road user that futures meet."""
    length_m = vehicle.length_m.value
    ahead_m = box_centre_from_base_m(vehicle)
    return RoadUser(
        user_id=state.vehicle_id,
        kind=kind_by_length(length_m),
        position=_moved(state.position, state.yaw_rad, ahead_m),
        yaw_rad=state.yaw_rad,
        speed_mps=state.speed_mps,
        length_m=length_m,
        width_m=vehicle.width_m.value,
    )


def _source_of(beside: Beside, own: VehicleInfo) -> LogBeside | LiveBeside | DetectedBeside:
    config = beside.config
    if config.log is not None:
        return LogBeside(
            Path(config.log), config.id, beside.vehicle, own=own, offset_s=config.log_offset_s
        )
    if config.seen_as is not None:
        return DetectedBeside(config.id, config.seen_as, beside.vehicle)
    return LiveBeside(config.id, beside.vehicle)


class VehiclesBeside:
    """All vehicles beside the car: passes their states on, and shows them to futures."""

    def __init__(self, plan: DrivePlan, *, publish: Callable[[OtherVehicles], None]) -> None:
        self._crew = crew = plan.beside
        self._sources: dict[str, LogBeside | LiveBeside | DetectedBeside] = {}
        self._vehicles = {one.config.id: one.vehicle for one in crew}
        self._seen_as = {one.config.seen_as for one in crew}
        self._frame = plan.drive_frame
        self._publish = publish
        self._latest: dict[str, VehicleState] = {}
        self._detected_ns: int | None = None

    def begin(self, own: VehicleInfo) -> None:
        """Open what there is, now that the car's clock is known; raises what readers raise."""
        self._sources = {one.config.id: _source_of(one, own) for one in self._crew}

    def take_sample(self, vehicle_id: str, item: Received) -> None:
        """Take a sample of a vehicle on the bus."""
        source = self._sources.get(vehicle_id)
        if isinstance(source, LiveBeside):
            source.take(item)

    def keep_up_with(self, own: VehicleState, detected: RoadUsers | None) -> None:
        """Pass on everything up to the car's own new state; `detected` is what it saw last."""
        if not self._sources:
            return
        if detected is not None and detected.stamp_ns != self._detected_ns:
            self._detected_ns = detected.stamp_ns
            for source in self._sources.values():
                if isinstance(source, DetectedBeside):
                    source.take(detected)
        heard = [one for s in self._sources.values() for one in s.states_until(own)]
        heard.sort(key=lambda one: (one.state.stamp_ns, one.state.vehicle_id))
        self._latest |= {one.state.vehicle_id: one.state for one in heard}
        self._publish(OtherVehicles(stamp_ns=own.stamp_ns, heard=tuple(heard)))

    def among(
        self, said: Surroundings, own: VehicleState, roles: Mapping[str, Role]
    ) -> Surroundings:
        """Return what surrounds the car with these vehicles in it, ghosts excepted."""
        if not self._sources:
            return said
        mine = [
            road_user(state, self._vehicles[name])
            for name, state in self._latest.items()
            if roles.get(name) in ("twin", "shadow")
            and abs(own.stamp_ns - state.stamp_ns) <= FRESH_NS
        ]
        users = said.road_users
        fresh = users is not None and abs(own.stamp_ns - users.stamp_ns) <= FRESH_NS
        detected = [
            user
            for user in (users.users if fresh and users is not None else ())
            if user.user_id not in self._seen_as and not any(self._same(user, one) for one in mine)
        ]
        return said._replace(road_users=RoadUsers(stamp_ns=own.stamp_ns, users=(*detected, *mine)))

    def _same(self, one: RoadUser, other: RoadUser) -> bool:
        frame = self._frame
        a, b = (
            local_from_geo(frame, user.position.lat_deg, user.position.lon_deg)
            for user in (one, other)
        )
        return float(np.hypot(*(a - b))) < SAME_WITHIN_M
