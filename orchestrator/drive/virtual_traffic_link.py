"""What the orchestrator tells virtual traffic and hears of it: its course, its road users."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.drive import RoadUser, RoadUsers, VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.too_old import USERS_FOR_NS
from foretwin.contracts.virtual_traffic import TrafficCourse
from foretwin.orchestrator.context import DriveContext
from foretwin.orchestrator.drive import traffic_setup
from foretwin.orchestrator.drive.intake import Intake
from foretwin.orchestrator.drive.questions import Questions
from foretwin.orchestrator.drive.traffic_setup import TRAFFIC
from foretwin.orchestrator.instructions import LatestReports, RoundIntent
from foretwin.orchestrator.runtime_configuration.handler import Made, RefusedError

_STEP_NS = 50_000_000
RECORDED_EVERY_NS, MOST_RECORDED = 200_000_000, 64
"""So often, and so many of those nearest to the car, stand in the table `virtual_road_users`.
Chosen: at 5 Hz nobody's speed changes by more than 1.6 m/s in between, and the table of an hour has
a million rows at most."""


@dataclass(slots=True)
class VirtualTrafficLink:
    """Tells virtual traffic the way ahead, and shows its road users to futures."""

    context: DriveContext
    questions: Questions
    intake: Intake
    latest: RoadUsers | None = None
    heard: int = 0
    most: int = 0
    on: bool = True
    keys: str = "virtual_traffic"
    at_once: bool = False
    _first_ns: int | None = None
    _recorded_ns: int | None = None
    _plane: LocalFrame | None = None
    _course: TrafficCourse | None = None

    @property
    def runs(self) -> bool:
        """Whether this drive has virtual traffic."""
        return traffic_setup.runs(self.context.plan)

    def take(self, users: RoadUsers) -> None:
        """Take where its road users are."""
        self.latest = users
        self.heard += 1
        self.most = max(self.most, len(users.users))
        if self._first_ns is None:
            self._first_ns = users.stamp_ns
        since_ns = None if self._recorded_ns is None else users.stamp_ns - self._recorded_ns
        if since_ns is None or not 0 <= since_ns < RECORDED_EVERY_NS:
            self._recorded_ns = users.stamp_ns
            rows = [_row(user, users.stamp_ns) for user in self._nearest(users.users)]
            self.context.tables.add("virtual_road_users", rows)

    def _nearest(self, users: tuple[RoadUser, ...]) -> tuple[RoadUser, ...]:
        """Return those of a crowd who are nearest to the car, in their order."""
        car = self.intake.latest
        if len(users) <= MOST_RECORDED or car is None:
            return users[:MOST_RECORDED]
        places = (car.state.position, *(one.position for one in users))
        self._plane = self._plane or LocalFrame(places[0])
        degrees = np.array([(place.lat_deg, place.lon_deg) for place in places])
        here, *there = local_from_geo(self._plane, *degrees.T)
        apart_m = np.hypot(*(np.array(there) - here).T)
        return tuple(users[k] for k in sorted(np.argsort(apart_m, kind="stable")[:MOST_RECORDED]))

    def met_in(
        self, intent: RoundIntent, reports: LatestReports, own: VehicleState
    ) -> LatestReports:
        """Tell it where the car will drive in the World of a round, and return what surrounds the
        car with virtual road users in it, whose ids win."""
        if not self.runs:
            return reports
        self._tell(
            TrafficCourse(
                stamp_ns=0,
                start_stamp_ns=0,
                world_id=intent.world_id,
                path=intent.path,
                signals=reports.signals,
            )
        )
        virtual = self.latest
        if virtual is None or abs(own.stamp_ns - virtual.stamp_ns) > USERS_FOR_NS:
            return reports
        users = reports.road_users
        fresh = users is not None and abs(own.stamp_ns - users.stamp_ns) <= USERS_FOR_NS
        ids = {user.user_id for user in virtual.users}
        seen = users.users if fresh and users is not None else ()
        others = tuple(user for user in seen if user.user_id not in ids)
        together = RoadUsers(stamp_ns=own.stamp_ns, users=(*others, *virtual.users))
        return reports._replace(road_users=together)

    def process_up(self, process_id: str) -> None:
        """Tell it, once it is there, what was told last: it has been started again."""
        if process_id == TRAFFIC and self._course is not None:
            self._tell(self._course)

    def _tell(self, course: TrafficCourse) -> None:
        self._course = msgspec.structs.replace(
            course,
            stamp_ns=self.intake.next_stamp_ns,
            start_stamp_ns=self.intake.start_stamp_ns,
            on=self.on,
        )
        self.questions.ask(TRAFFIC, "use_course", self._course)

    @property
    def is_behind(self) -> bool:
        """Whether what it makes of the newest state is still to come; asked in lock step."""
        if not (self.on and TRAFFIC in self.questions.alive) or self._course is None:
            return False
        told_ns = self.intake.now_stamp_ns
        if told_ns < self._course.stamp_ns:
            return False
        return self.latest is None or told_ns - self.latest.stamp_ns >= _STEP_NS

    def check(self, name: str, value: str) -> None:
        """Raise RefusedError where there is no virtual traffic to switch, or for another value."""
        if name or value not in ("on", "off"):
            raise RefusedError(f"virtual_traffic={value}: must be virtual_traffic=on or off")
        if not self.runs:
            raise RefusedError("virtual_traffic: this drive was started without any")

    def make(self, name: str, value: str, *, stamp_ns: int) -> Made:
        """Switch it on or off from `stamp_ns` on."""
        before, self.on = "on" if self.on else "off", value == "on"
        self.process_up(TRAFFIC)
        return Made(before, value)

    def record(self) -> dict[str, Any]:
        """Return the `virtual_traffic` of run.json: how often its road users were heard of, per
        second of the drive, and how many of its steps were not."""
        if not self.runs or self.latest is None or self._first_ns is None:
            return {"messages": self.heard, "most_users": self.most, "rate_hz": None, "missed": 0}
        passed_ns = self.latest.stamp_ns - self._first_ns
        due = passed_ns // _STEP_NS + 1
        return {
            "messages": self.heard,
            "most_users": self.most,
            "rate_hz": round((self.heard - 1) / (passed_ns / 1e9), 3) if passed_ns > 0 else None,
            "missed": max(0, due - self.heard),
        }


def _row(user: RoadUser, stamp_ns: int) -> dict[str, Any]:
    return {
        "stamp_ns": stamp_ns,
        "user_id": user.user_id,
        "kind": user.kind,
        "lat_deg": user.position.lat_deg,
        "lon_deg": user.position.lon_deg,
        "yaw_rad": user.yaw_rad,
        "speed_mps": user.speed_mps,
        "length_m": user.length_m,
        "width_m": user.width_m,
    }
