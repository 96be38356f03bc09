"""The mission: follows the car on its route, says which Worlds to build and rounds to run.

A state machine without bus and clock: states and worlds in, instructions out. Wall times come in
as arguments and are only remembered, never decided upon.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.running import FirstOf
from foretwin.contracts.world import World
from foretwin.orchestrator.drive.visits import Moment, Visit, VisitBook
from foretwin.orchestrator.instructions import (
    BuildWorld,
    Instruction,
    Notice,
    NotReady,
    RoundIntent,
    UseWorld,
)
from foretwin.orchestrator.routing.arrival import NextJunction
from foretwin.orchestrator.routing.junctions_ahead import PassedJunction
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_ahead import WayAhead
from foretwin.telemetry.estimator.map_aid import RoadLine
from foretwin.world_gen.junctions.intersections import Junction

MissionState = Literal["waiting", "following", "off_map"]

MATCH_PERIOD_NS = 100_000_000
KEEP_PAST_CENTRE_M = 20.0
"""A junction stays the current one until the car is this far past its centre."""

_WHY_OFF_ROAD = {
    "no_car_road": "which the map does not give to cars",
    "against_one_way": "against a one-way street of the map",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionSettings:
    """When Worlds are built and rounds run; where in its log (`begins_s`) the drive begins."""

    radius_m: float = 150.0
    look_ahead_s: float = 60.0
    horizon_s: float = 8.0
    begins_s: float = 0.0


class Mission:
    """One drive along one way."""

    def __init__(
        self, way: WayAhead, settings: MissionSettings, *, start_stamp_ns: int = 0
    ) -> None:
        self.state: MissionState = "waiting"
        self.start_stamp_ns = start_stamp_ns
        self.road_line: RoadLine | None = None
        """The line that the latest state drives along; None in doubt, or between two matches."""
        self.way = way
        self._settings = settings
        self.visits = VisitBook()
        self._current: str | None = None
        self._passed_s_m: float | None = None
        self._car: VehicleState | None = None
        self._last_match_ns: int | None = None
        self._stretches_reported = 0
        self._off_route_reported = False
        self._map_reported = False

    # What comes in.

    def before_start(self, junctions: Iterable[Junction], *, mono_s: float) -> list[Instruction]:
        """Ask for the Worlds where a given route begins, before the car moves."""
        at = Moment(mono_s, self.drive_time_s)
        return [
            BuildWorld(junction.summary.id, load=True)
            for junction in junctions
            if self.visits.see(junction, at, load=True)
        ]

    def give_route(self, route: Route) -> None:
        """Follow this route from the next state on."""
        self.way.give(route)

    def on_state(self, state: VehicleState, *, mono_s: float) -> list[Instruction]:
        """Take where the car is."""
        self._car = state
        self.way.take_speed(state)
        self.road_line = None
        if not self._time_to_match(state):
            return []
        passed = self.way.locate(state)
        if passed is None:
            return self._off_map()
        self.road_line = self.way.road_line(state)
        todo: list[Instruction] = []
        if self.state != "following":
            text = "on the map" if self.state == "waiting" else "back on the map"
            todo.append(Notice("info", f"{text}: {self.way.road_text}"))
            self.state = "following"
        at = Moment(mono_s, self.drive_time_s)
        for junction in passed:
            todo += self._arrive(junction, at)
        todo += self._wanted_worlds(at)
        todo += self._choose_current()
        todo += self._deviations()
        if state.map_shift_m is not None and not self._map_reported:
            self._map_reported = True
            todo.append(Notice("info", "position from GNSS and the map"))
        return todo

    def on_world(self, junction_id: str, world: World, *, mono_s: float) -> list[Instruction]:
        """A junction's World is built and loaded by the workers."""
        self.visits.take_world(junction_id, world, Moment(mono_s, self.drive_time_s))
        return self._choose_current()

    def on_world_failed(self, junction_id: str, reason: str) -> list[Instruction]:
        """A junction's World cannot be built; the drive goes on without it."""
        self.visits.fail(junction_id)
        name = self.visits.name_of(junction_id)
        return [Notice("error", f"no world for {name}: {reason}")]

    def on_round(self, junction_id: str, *, futures: int) -> None:
        """A round for a junction is complete."""
        self.visits.count_round(junction_id, futures=futures)

    # What goes out.

    @property
    def drive_time_s(self) -> float:
        """Seconds since the drive's start, by the vehicle's clock."""
        car, before_s = self._car, self._settings.begins_s
        return before_s if car is None else (car.stamp_ns - self.start_stamp_ns) / 1e9

    @property
    def next_junction(self) -> NextJunction | None:
        """The junction ahead, as it is shown."""
        for ahead in self.way.junctions[:1]:
            summary = ahead.junction.summary
            name = summary.name or summary.id
            in_s = self.way.countdown_s
            return NextJunction(name, in_s, ahead.distance_m, summary.id, summary.control)
        return None

    @property
    def junction_id(self) -> str | None:
        """The junction that the car is at, or has before it."""
        if self._current is not None:
            return self._current
        return next((a.junction.summary.id for a in self.way.junctions), None)

    @property
    def route_m(self) -> float | None:
        """How far along its route the car is, None off the map."""
        return self.way.s_m if self.state == "following" else None

    def worlds_ahead(self) -> list[str]:
        """Ids of the Worlds that the coming rounds need, the current one first."""
        ids = [self._current] if self._current else []
        ids += [ahead.junction.summary.id for ahead in self.way.junctions]
        visits = [self.visits.get(junction_id) for junction_id in dict.fromkeys(ids)]
        return [v.world.id for v in visits if v is not None and v.load and v.world is not None]

    @property
    def wants_rounds(self) -> bool:
        """Whether rounds are due where the car is: a junction is within the look-ahead."""
        if self.state != "following" or self._car is None:
            return False
        return self._current is not None or bool(self._within_look_ahead())

    def plan_round(self) -> RoundIntent | NotReady | None:
        """Return the round to run now; None where no junction is within the look-ahead."""
        car, horizon_s = self._car, self._settings.horizon_s
        if car is None or not self.wants_rounds:
            return None
        visit = self.visits.latest(self._current) if self._current else None
        if visit is None or visit.world is None:
            return NotReady("the world is not ready", world_late=True)
        if not car.yaw_valid:
            return NotReady("the heading is not known", world_late=False)
        path = self.way.path(visit.world, speed_mps=car.speed_mps, horizon_s=horizon_s)
        if path is None:
            return NotReady("the road ends here", world_late=False)
        return RoundIntent(
            junction_id=visit.junction.summary.id,
            world_id=visit.world.id,
            path=path,
            cruise_speed_mps=self.way.cruise_speed_mps,
            speed_ahead_mps=self.way.speeds_ahead(horizon_s=horizon_s),
            bend_accel_mps2=self.way.bend_accel_mps2,
            off_lanes_m=self.way.off_lanes_m,
            next_junction=next(
                ((a.junction.summary.control, a.distance_m) for a in self.way.junctions), None
            ),
        )

    @property
    def arrived(self) -> FirstOf[Visit]:
        """The intersections that the car reached, in order."""
        return self.visits.arrived

    def _time_to_match(self, state: VehicleState) -> bool:
        last = self._last_match_ns
        if last is not None and 0 <= state.stamp_ns - last < MATCH_PERIOD_NS:
            return False
        self._last_match_ns = state.stamp_ns
        return True

    def _within_look_ahead(self) -> list[str]:
        return [
            ahead.junction.summary.id
            for ahead in self.way.junctions
            if ahead.in_s <= self._settings.look_ahead_s
        ]

    def _off_map(self) -> list[Instruction]:
        self._passed_s_m = None
        if self.state in ("off_map", "waiting"):
            return []
        self.state = "off_map"
        todo: list[Instruction] = [
            Notice("warning", "off the map: no rounds until the car is back")
        ]
        if self._current is not None:
            self._current = None
            todo.append(UseWorld(None))
        return todo

    def _arrive(self, passed: PassedJunction, at: Moment) -> list[Instruction]:
        summary = passed.junction.summary
        todo: list[Instruction] = []
        if self.visits.see(passed.junction, at, load=True):
            todo.append(BuildWorld(summary.id, load=True))
        self.visits.arrive(summary.id, at)
        self._passed_s_m = passed.centre_s_m
        text = f"passed {summary.kind} {summary.name or summary.id} ({summary.control})"
        return [*todo, Notice("info", text)]

    def _wanted_worlds(self, at: Moment) -> list[Instruction]:
        soon = set(self._within_look_ahead())
        wanted = [
            (ahead.junction, True)
            for ahead in self.way.junctions
            if ahead.junction.summary.id in soon
        ]
        wanted += [(junction, False) for junction in self.way.other_turns]
        todo: list[Instruction] = [
            BuildWorld(junction.summary.id, load)
            for junction, load in wanted
            if self.visits.see(junction, at, load=load)
        ]
        for ahead in self.way.junctions:
            if ahead.distance_m <= self._settings.radius_m:
                self.visits.enter(ahead.junction.summary.id, at)
        return todo

    def _choose_current(self) -> list[Instruction]:
        """The junction just passed stays current for a while; then the next one within reach."""
        if self.state != "following":
            return []
        if self._passed_s_m is not None:
            away_m = self.way.s_m - self._passed_s_m
            if away_m < KEEP_PAST_CENTRE_M and self._current is not None:
                return []
            self._passed_s_m = None
        chosen = None
        for junction_id in self._within_look_ahead():
            visit = self.visits.get(junction_id)
            if visit is None or visit.failed:
                continue
            chosen = junction_id if visit.world is not None else None
            break
        if chosen == self._current:
            return []
        self._current = chosen
        world = self.visits.latest(chosen).world if chosen else None
        return [UseWorld(world.id if world is not None else None)]

    def _deviations(self) -> list[Instruction]:
        todo: list[Instruction] = []
        if self.way.off_route != self._off_route_reported:
            self._off_route_reported = self.way.off_route
            if self._off_route_reported:
                todo.append(Notice("warning", "left the given route; the way ahead is predicted"))
            else:
                todo.append(Notice("info", "back on the given route"))
        stretches = self.way.off_road_stretches
        if len(stretches) > self._stretches_reported:
            self._stretches_reported = len(stretches)
            last = stretches[-1]
            ways = ", ".join(str(way) for way in last.way_ids)
            why = _WHY_OFF_ROAD[last.reason]
            todo.append(Notice("warning", f"drives on {last.name or 'a way'} {why} (way {ways})"))
        return todo
