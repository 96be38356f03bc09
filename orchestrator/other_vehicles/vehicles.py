"""Vehicles beside the car: from a log, the bus or the car's own detections to states in its time.

Nothing is taken that is later than the car's own newest state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.bus import Received, Request
from foretwin.contracts.drive import InfoRequest, RoadUser, RoadUsers, VehicleInfo, VehicleState
from foretwin.contracts.fleet import ClockQuestion
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.keys import vehicle_that_joins
from foretwin.contracts.mailbox import Reply
from foretwin.contracts.roles import JoinRequest, OtherVehicles, Role
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.instructions import LatestReports
from foretwin.orchestrator.other_vehicles.dead_reckoning import reckoned, reckoned_for_s
from foretwin.orchestrator.other_vehicles.detected import DetectedVehicle
from foretwin.orchestrator.other_vehicles.encounter_handler import EncounterHandler
from foretwin.orchestrator.other_vehicles.joined import JoinedVehicles
from foretwin.orchestrator.other_vehicles.live import LiveVehicle
from foretwin.orchestrator.other_vehicles.measured import OtherVehicleSource
from foretwin.orchestrator.other_vehicles.recorded import RecordedVehicle
from foretwin.orchestrator.other_vehicles.surroundings import Measured, road_user, surroundings
from foretwin.orchestrator.other_vehicles.vehicle_clock import (
    THE_SAME,
    ClockReading,
    VehicleClock,
)
from foretwin.orchestrator.plan import OtherVehiclePlan

ASK_EVERY_S = 1.0
"""How often vehicles are asked for the time on board."""
TOLD_EVERY_NS = 50_000_000
"""How often live vehicles are told who is around them."""
SAME_WITHIN_M = 2.0
"""A detection whose centre is so near to that of a vehicle with telemetry of its own is it."""


class OtherVehicleFeed:
    """All vehicles beside the car: passes their states on, and shows them to futures."""

    def __init__(
        self, context: DriveContext, own_offset_ns: Callable[[], int | None] = lambda: None
    ) -> None:
        """What vehicles say when they are asked lands in the mailbox, for `take_info`, `take_time`.

        `own_offset_ns` is receipt less stamp of the car's least delayed sample.
        """
        plan = context.plan
        self._context, self._crew, self._frame = context, plan.beside, plan.drive_frame
        self.encounters = EncounterHandler(plan, context.tables, context.tell)
        self._sources: dict[str, OtherVehicleSource] = {}
        self._vehicles = {one.config.id: one.vehicle for one in plan.beside}
        self._joined = JoinedVehicles(plan, context.tell)
        self._told_ns = 0
        self._seen_as = {one.config.seen_as for one in plan.beside}
        self._latest: dict[str, VehicleState] = {}
        self._detected_ns: int | None = None
        self._own_clock, self._own_offset_ns = VehicleClock(), own_offset_ns
        self._ask_at_s = 0.0

    def begin(self, own: VehicleInfo) -> None:
        """Open what there is, now that the car's clock is known."""
        self._sources = {one.config.id: self._source(one, own) for one in self._crew}

    def close(self) -> None:
        """End what goes on, and let go of files and threads; idempotent."""
        self.encounters.finish()
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
                lot=beside.lot,
                tell=self._context.tell,
            )
        if config.seen_as is not None:
            return DetectedVehicle(config.id, config.seen_as, vehicle)
        own_clock = None if config.same_clock else self._own_reading
        return LiveVehicle(
            config.id,
            vehicle,
            ask_info=self._ask_info,
            tell=self._context.tell,
            own_clock=own_clock,
        )

    def _own_reading(self) -> ClockReading | None:
        return self._own_clock.reading(self._own_offset_ns())

    @property
    def _live(self) -> dict[str, LiveVehicle]:
        sources = self._sources.items()
        return {name: one for name, one in sources if isinstance(one, LiveVehicle)}

    @property
    def _asked(self) -> dict[str, VehicleClock]:
        """The clocks of who is asked: of live vehicles, and the car's where there are any."""
        live = {name: source.clock for name, source in self._live.items()}
        return live | {self._context.plan.config.vehicle_id: self._own_clock} if live else {}

    def look(self, now_s: float) -> None:
        """Ask for the time on board where that is due by our monotonic clock; call it often."""
        if now_s < self._ask_at_s:
            return
        self._ask_at_s = now_s + ASK_EVERY_S
        bus, mailbox = self._context.bus, self._context.mailbox
        for name in self._asked:
            asked = name, round(now_s * 1e9)
            bus.request(
                "vehicle_clock", ClockQuestion(), mailbox, tag=asked, timeout_s=2.0, vehicle=name
            )

    def take_time(self, reply: Reply) -> None:
        """Take an answer to what time it is on board; who does not answer is judged by samples."""
        vehicle_id, asked_ns = reply.tag
        for source in self._live.values():  # what came before this answer was taken before it
            source.look(reply.received_mono_ns / 1e9)
        clock = self._asked.get(vehicle_id)
        if reply.message is not None and clock is not None:
            clock.answered(asked_ns, reply.received_mono_ns, reply.message.stamp_ns)

    def clocks(self) -> dict[str, Any]:
        """Return what run.json says of the clocks of live vehicles."""
        return {
            name: {"behind_car_s": found.later_ns / 1e9, "std_s": found.std_s, "how": found.how}
            for name, source in self._live.items()
            if (found := source.found) is not None
        }

    def _ask_info(self, vehicle_id: str) -> None:
        bus, mailbox = self._context.bus, self._context.mailbox
        bus.request("info", InfoRequest(), mailbox, tag=vehicle_id, vehicle=vehicle_id)

    def take_sample(self, vehicle_id: str, item: Received) -> None:
        """Take a sample of a vehicle on the bus; raises Refused for what the guard keeps out."""
        item.message()
        source = self._sources.get(vehicle_id)
        if isinstance(source, LiveVehicle):
            source.take(item)

    def take_join(self, question: Request) -> None:
        """Answer who asks to speak as a vehicle beside the car, or says that it leaves."""
        name, now_s = vehicle_that_joins(question.key), question.received_mono_ns / 1e9
        asked: JoinRequest = question.message()
        question.reply(self._joined.answer(name, asked, self._live.get(name), now_s=now_s))

    def take_info(self, vehicle_id: str, info: VehicleInfo | None) -> None:
        """Take what a vehicle on the bus says of itself, None where it does not answer."""
        source = self._sources.get(vehicle_id)
        if isinstance(source, LiveVehicle):
            source.take_info(info)

    def keep_up_with(
        self, own: VehicleState, detected: RoadUsers | None, roles: Mapping[str, Role]
    ) -> None:
        """Pass on everything up to the car's own new state, and judge who meets whom.

        `detected` is what it saw last.
        """
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
        self.encounters.keep_up_with(own, heard, roles)
        if self._live and abs(own.stamp_ns - self._told_ns) >= TOLD_EVERY_NS:
            self._told_ns = own.stamp_ns
            self._tell_surroundings(own, roles)

    def _tell_surroundings(self, own: VehicleState, roles: Mapping[str, Role]) -> None:
        """Tell each live vehicle, and the car, of the others; ghosts meet nobody."""
        plan = self._context.plan
        clocks = {name: one.between for name, one in self._live.items()}
        if plan.ros2 is None:  # else the car hears of them by its gateway, from the mirror
            clocks[plan.config.vehicle_id] = THE_SAME
        there = [Measured(own, plan.vehicle)] if own.yaw_valid else []
        there += [
            Measured(self._latest[name], self._vehicles[name])
            for name in clocks
            if name in self._latest
        ]
        for name, clock in clocks.items():
            if clock is None or roles.get(name) == "ghost":
                continue
            others = [
                one
                for one in there
                if (other := one.state.vehicle_id) != name and roles.get(other) != "ghost"
            ]
            message = surroundings(others, stamp_ns=own.stamp_ns, later_ns=clock.later_ns)
            self._context.bus.publish("surroundings", message, vehicle=name)

    def among(
        self, reports: LatestReports, own: VehicleState, roles: Mapping[str, Role]
    ) -> LatestReports:
        """Return what surrounds the car with these vehicles in it, ghosts excepted.

        Each is where it is reckoned to be at the car's own stamp.
        """
        if not self._sources:
            return reports
        mine = [
            road_user(reckoned(state, own.stamp_ns), self._vehicles[name])
            for name, state in self._latest.items()
            if roles.get(name) in ("twin", "shadow") and self._is_known(name, own.stamp_ns)
        ]
        users = reports.road_users
        fresh = users is not None and abs(own.stamp_ns - users.stamp_ns) <= USERS_FOR_NS
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

    def _is_known(self, name: str, stamp_ns: int) -> bool:
        age_s = abs(stamp_ns - self._latest[name].stamp_ns) / 1e9
        return age_s <= reckoned_for_s(self._vehicles[name])

    def _same(self, seen: Sequence[RoadUser], mine: Sequence[RoadUser]) -> Flags:
        """Return which of those that were seen are vehicles that are known anyway, (N,)."""
        apart = self._places(seen)[:, None] - self._places(mine)
        same = np.hypot(apart[..., 0], apart[..., 1]) < SAME_WITHIN_M
        return np.asarray(same.any(axis=1))

    def _places(self, users: Sequence[RoadUser]) -> Array:
        positions = [(user.position.lat_deg, user.position.lon_deg) for user in users]
        return local_from_geo(self._frame, *np.array(positions).reshape(-1, 2).T)
