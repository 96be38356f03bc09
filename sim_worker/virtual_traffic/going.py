"""The state machine of virtual traffic: states of the car in, road users at each instant out.

It has no clock: it steps in the car's own time, so that the same seed and the same states give the
same traffic to the last bit.
"""

from __future__ import annotations

from collections import deque

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import RoadUser, RoadUsers, SignalColour, VehicleState
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    grid_convergence,
    wrap_angle,
)
from foretwin.contracts.lights import ShownLights
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.virtual_traffic import TrafficCourse
from foretwin.contracts.world import World
from foretwin.sim_worker.vehicle.seeding import local_state
from foretwin.sim_worker.virtual_traffic.source import STEP_S, TrafficSource, VirtualUser
from foretwin.world_gen.rules.signal_state import LiveColour, colours_at

STEP_NS = round(STEP_S * 1e9)
_MOST_STEPS = 24
"""At once: receivers that say once a second where the car is are the slowest, and say it a little
late. Who has missed more of the car than that goes on from where it is, and says so."""


class ToldCourse(msgspec.Struct, frozen=True):
    """A course with its World, None where that is the one before."""

    told: TrafficCourse
    world: World | None


class GoingTraffic:
    """Feeds a source with what the car does; `missed` counts steps that were left out."""

    def __init__(self, source: TrafficSource, vehicle: VehicleParameters) -> None:
        self._source, self._vehicle = source, vehicle
        self._world: World | None = None
        self._courses: deque[ToldCourse] = deque()
        self._start_ns = 0
        self._next_ns: int | None = None
        self._on = True
        self._heard: dict[str, tuple[int, SignalColour]] = {}
        self.missed = 0

    def take_course(self, told: TrafficCourse, world: World | None) -> None:
        """Take what counts from the stamp in it on; `world` where it is another one."""
        self._courses.append(ToldCourse(told, world))

    def take_lights(self, shown: ShownLights) -> None:
        """Take what lights show, at once."""
        self._heard |= {one.group_id: (shown.stamp_ns, one.colour) for one in shown.lights}

    def take_state(self, state: VehicleState) -> tuple[RoadUsers, ...]:
        """Return the road users at all instants that have passed up to a state of the car."""
        found: list[RoadUsers] = []
        while self._courses and self._courses[0].told.stamp_ns <= state.stamp_ns:
            found += self._use(self._courses.popleft(), state.stamp_ns)
        if self._world is None or not self._on:
            self._next_ns = None
            return tuple(found)
        passed_ns = 0 if self._next_ns is None else state.stamp_ns - self._next_ns
        if self._next_ns is None or not -STEP_NS <= passed_ns < _MOST_STEPS * STEP_NS:
            # It begins, the clock has stepped back, or nothing was heard for long.
            if self._next_ns is not None:
                self.missed += max(0, passed_ns // STEP_NS)
            self._next_ns = state.stamp_ns
        assert self._source.frame is not None
        row = local_state(state, self._source.frame, self._vehicle)
        while self._next_ns <= state.stamp_ns:
            found.append(self._step(row, self._next_ns))
            self._next_ns += STEP_NS
        return tuple(found)

    def _use(self, course: ToldCourse, stamp_ns: int) -> list[RoadUsers]:
        told, was_on = course.told, self._on
        self._on, self._start_ns = told.on, told.start_stamp_ns
        if course.world is not None:
            self._world = course.world
            self._source.use_world(course.world)
        if told.path is not None and self._world is not None:
            self._source.use_path(told.path.xy_m)
        self._heard |= {one.group_id: (one.stamp_ns, one.colour) for one in told.signals}
        # Whoever shows or obeys them is told once that there is nobody any more.
        return [RoadUsers(stamp_ns=stamp_ns, users=())] if was_on and not told.on else []

    def _step(self, car: Array, stamp_ns: int) -> RoadUsers:
        assert self._source.frame is not None
        time_s = (stamp_ns - self._start_ns) * 1e-9
        users = self._source.step(car, time_s=time_s, colours=self._colours(time_s))
        return RoadUsers(stamp_ns=stamp_ns, users=_on_earth(users, self._source.frame))

    def _colours(self, time_s: float) -> dict[str, SignalColour]:
        """Return what lights show: as heard, else by the World's plans."""
        world = self._world
        assert world is not None
        heard = {
            group: LiveColour((stamp_ns - self._start_ns) * 1e-9, colour)
            for group, (stamp_ns, colour) in self._heard.items()
        }
        plans = [junction.plan for junction in world.junctions if junction.plan is not None]
        found: dict[str, SignalColour] = {}
        for plan in (*plans, *world.crossing_plans):
            found.update(colours_at(plan, time_s, heard))
        return found


def _on_earth(users: tuple[VirtualUser, ...], frame: LocalFrame) -> tuple[RoadUser, ...]:
    if not users:
        return ()
    place = np.array([(user.x_m, user.y_m, user.yaw_rad) for user in users])
    lat, lon = geo_from_local(frame, place[:, :2]).T
    yaw = wrap_angle(place[:, 2] - grid_convergence(frame, lat, lon))
    return tuple(
        RoadUser(
            user_id=user.user_id,
            kind=user.kind,
            position=GeoPoint(*at),
            yaw_rad=heading,
            speed_mps=user.speed_mps,
            length_m=user.length_m,
            width_m=user.width_m,
            virtual=True,
        )
        for user, at, heading in zip(
            users, zip(lat.tolist(), lon.tolist(), strict=True), yaw.tolist(), strict=True
        )
    )
