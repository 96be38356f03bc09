"""Who speaks for the live vehicles of a drive: one at a time for each."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from foretwin.contracts.roles import JoinReply, JoinRequest
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.other_vehicles.live import LiveVehicle
from foretwin.orchestrator.plan import DrivePlan

SEAT_S = 5.0
"""Who has not asked again for so long speaks for its vehicle no more: it asks every second."""


class _Seat(NamedTuple):
    instance: str
    asked_s: float


class JoinedVehicles:
    """Gives the seat of each live vehicle to one who asks for it."""

    def __init__(self, plan: DrivePlan, tell: Callable[[Notice], None]) -> None:
        self._own, self._frame, self._tell = plan.config.vehicle_id, plan.drive_frame, tell
        open_to = (one for one in plan.beside if one.config.live and one.ros2 is None)
        self._scales = {one.config.id: one.scale for one in open_to}
        self._seats: dict[str, _Seat] = {}

    def answer(
        self, vehicle_id: str, asked: JoinRequest, source: LiveVehicle | None, *, now_s: float
    ) -> JoinReply:
        """Return whether it may speak; `source` is None before the car's own clock is known."""
        seat = self._seats.get(vehicle_id)
        mine = seat is not None and seat.instance == asked.instance
        if seat is not None and not mine and now_s - seat.asked_s > SEAT_S:
            seat = None
        if trouble := self._trouble(vehicle_id, asked, seat):
            return JoinReply(refused=trouble)
        if source is None:
            return JoinReply(trouble=f"{self._own} was not heard yet: it has to drive first")
        if asked.leaves:
            if self._seats.pop(vehicle_id, None) is not None:
                source.begin_anew()
                self._tell(Notice("info", f"{vehicle_id} has left"))
            return JoinReply()
        if seat is None:
            source.begin_anew()
            self._tell(Notice("info", f"{vehicle_id} joins"))
        self._seats[vehicle_id] = _Seat(asked.instance, now_s)
        clock = source.between
        return JoinReply(
            drive_frame=self._frame,
            clock="" if clock is None else clock.text,
            trouble=source.trouble,
            over=source.over,
        )

    def _trouble(self, vehicle_id: str, asked: JoinRequest, seat: _Seat | None) -> str:
        if vehicle_id not in self._scales:
            mine = "is the drive's own car" if vehicle_id == self._own else "has no seat here"
            names = ", ".join(sorted(self._scales)) or "of none"
            return (
                f"{vehicle_id} {mine}: seats are those of [[vehicles]] with live = true and "
                f"without ros2: {names}"
            )
        if seat is not None and seat.instance != asked.instance:
            return f"{vehicle_id} has joined already, from somewhere else"
        scale = self._scales[vehicle_id]
        if asked.scale != scale:
            return (
                f"{vehicle_id} is a vehicle of scale {scale:g} in this drive, but its anchor says "
                f"scale = {asked.scale:g}"
            )
        return ""
