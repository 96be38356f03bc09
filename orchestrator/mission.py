"""The mission: follows the car on its route, says which Worlds to build and rounds to run.

A state machine without bus and clock: states and worlds in, instructions out. Wall times come in
as arguments and are only remembered, never decided upon.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from contracts.drive import VehicleState
from contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw, target_from_source
from contracts.simulation import PathAhead
from contracts.world import World
from orchestrator.arrival import DrivingPace, predict_arrivals
from orchestrator.cruise import CruiseSpeed
from orchestrator.driving_path import driving_path
from orchestrator.instructions import BuildWorld, Instruction, NotReady, RoundIntent, Tell, UseWorld
from orchestrator.junctions_ahead import PassedJunction, UpcomingJunction
from orchestrator.map_matching import MapMatcher, Match
from orchestrator.road_index import RoadIndex
from orchestrator.route import Route
from orchestrator.route_follower import Progress, RouteFollower
from orchestrator.visits import VisitBook
from world_gen.intersections import Junction
from world_gen.road_graph import RoadGraph

MissionState = Literal["waiting", "following", "off_map"]

MATCH_PERIOD_NS = 100_000_000
KEEP_PAST_CENTRE_M = 20.0
"""A junction stays the current one until the car is this far past its centre."""
PATH_BEHIND_M = 10.0
PATH_SPARE_M = 60.0
MIN_PATH_M = 20.0
ALTERNATIVES_M = 300.0
"""On a predicted route, Worlds of junctions that other turns lead to are built this far ahead."""
FAR_AHEAD_M = 3000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionSettings:
    """What decides when Worlds are built and rounds run."""

    radius_m: float = 150.0
    look_ahead_s: float = 60.0
    horizon_s: float = 8.0


class Mission:
    """One drive along one route."""

    def __init__(
        self,
        graph: RoadGraph,
        junctions: tuple[Junction, ...],
        routes: tuple[Route, ...],
        settings: MissionSettings,
        *,
        index: RoadIndex | None = None,
        start_stamp_ns: int = 0,
    ) -> None:
        self.state: MissionState = "waiting"
        self.start_stamp_ns = start_stamp_ns
        self._graph = graph
        self._settings = settings
        index = index or RoadIndex(graph)
        self._matcher = MapMatcher(graph, index=index)
        self._follower = RouteFollower(graph, junctions, routes, index=index)
        self._pace = DrivingPace()
        self._cruise = CruiseSpeed()
        self._given = bool(routes)
        self._visits = VisitBook()
        self._upcoming: tuple[UpcomingJunction, ...] = ()
        self._arrival_in_s: dict[str, float] = {}
        self._progress: Progress | None = None
        self._match: Match | None = None
        self._current: str | None = None
        self._passed_s_m: float | None = None
        self._car: VehicleState | None = None
        self._last_match_ns: int | None = None
        self._stretches_told = 0
        self._off_route_told = False

    # What comes in.

    def on_state(self, state: VehicleState, *, mono_s: float) -> list[Instruction]:
        """Take where the car is."""
        self._car = state
        self._cruise.update(state.stamp_ns, state.speed_mps)
        if not self._time_to_match(state):
            return []
        lat, lon = state.position.lat_deg, state.position.lon_deg
        xy = local_from_geo(self._graph.frame, lat, lon)
        yaw = float(local_from_geo_yaw(self._graph.frame, state.yaw_rad, lat, lon))
        self._match = self._matcher.update(xy, yaw, state.yaw_valid, state.speed_mps)
        self._progress = self._follower.update(self._match)
        if self._progress is None:
            return self._off_map()
        told: list[Instruction] = []
        if self.state != "following":
            text = "on the map" if self.state == "waiting" else "back on the map"
            told.append(Tell("info", f"{text}: {self._match_text()}"))
            self.state = "following"
        for passed in self._progress.passed:
            told += self._arrive(passed, mono_s)
        limit_mps = self._speed_limit_mps()
        self._pace.update(state.stamp_ns, state.speed_mps, limit_mps)
        self._look_ahead(mono_s)
        told += self._wanted_worlds(mono_s)
        told += self._choose_current()
        told += self._tell_deviations()
        return told

    def on_world(self, junction_id: str, world: World, *, mono_s: float) -> list[Instruction]:
        """A junction's World is built and loaded by the workers."""
        visit = self._visits.get(junction_id)
        assert visit is not None
        visit.take_world(world, mono_s=mono_s, drive_time_s=self.drive_time_s)
        return self._choose_current()

    def on_world_failed(self, junction_id: str) -> list[Instruction]:
        """A junction's World cannot be built; the drive goes on without it."""
        visit = self._visits.get(junction_id)
        assert visit is not None
        visit.failed = True
        return []

    def on_round(self, junction_id: str, *, futures: int) -> None:
        """A round for a junction is complete."""
        visit = self._visits.get(junction_id)
        assert visit is not None
        visit.rounds += 1
        visit.futures += futures

    # What goes out.

    @property
    def drive_time_s(self) -> float:
        """Seconds since the drive's start, by the vehicle's clock."""
        if self._car is None:
            return 0.0
        return (self._car.stamp_ns - self.start_stamp_ns) / 1e9

    @property
    def next_junction(self) -> tuple[str, float] | None:
        """Name of the junction ahead and seconds until the car is there."""
        if not self._upcoming:
            return None
        summary = self._upcoming[0].junction.summary
        return summary.name or summary.id, self._arrival_in_s[summary.id]

    def worlds_ahead(self) -> list[str]:
        """Ids of the Worlds that the coming rounds need, the current one first."""
        ids = [self._current] if self._current else []
        ids += [ahead.junction.summary.id for ahead in self._upcoming]
        visits = [self._visits.get(junction_id) for junction_id in dict.fromkeys(ids)]
        return [visit.world.id for visit in visits if visit is not None and visit.world is not None]

    def plan_round(self) -> RoundIntent | NotReady | None:
        """Return the round to run now; None where no junction is within the look-ahead."""
        car, progress = self._car, self._progress
        if self.state != "following" or car is None or progress is None:
            return None
        within = [
            ahead
            for ahead in self._upcoming
            if self._arrival_in_s[ahead.junction.summary.id] <= self._settings.look_ahead_s
        ]
        if not within and self._current is None:
            return None
        visit = self._visits.get(self._current) if self._current else None
        if visit is None or visit.world is None:
            return NotReady("the world is not ready")
        if not car.yaw_valid:
            return NotReady("the heading is not known")
        path = self._path_ahead(visit.world.frame, car.speed_mps)
        if path is None:
            return NotReady("the road ends here")
        return RoundIntent(
            junction_id=visit.junction.summary.id,
            world_id=visit.world.id,
            path=path,
            cruise_speed_mps=self._cruise.aim_mps(self._speed_limit_mps()),
        )

    def _path_ahead(self, frame: LocalFrame, speed_mps: float) -> PathAhead | None:
        """Return the path in a World's frame; None where the road ends within a few metres."""
        assert self._progress is not None
        s_m = self._progress.s_m
        if self._follower.route.end_m - s_m < MIN_PATH_M:
            return None
        reach_m = self._settings.horizon_s * max(speed_mps + 8.0, 15.0) + PATH_SPARE_M
        geometry = driving_path(
            self._graph, self._follower.route, s_from_m=s_m - PATH_BEHIND_M, s_to_m=s_m + reach_m
        )
        moved = target_from_source(
            frame, self._graph.frame, geometry.xy_m, np.zeros(len(geometry.xy_m))
        )
        return PathAhead(xy_m=moved.xy_m, speed_limit_mps=geometry.speed_limit_mps)

    def records(self, *, mono_s: float) -> list[dict[str, Any]]:
        """Return the `intersections` of run.json: those that the car reached, in order."""
        return [visit.record(mono_s=mono_s) for visit in self._visits.arrived]

    @property
    def off_road(self) -> list[dict[str, Any]]:
        """Stretches driven where the map says that cars may not."""
        return [
            {
                "reason": s.reason,
                "name": s.name,
                "way_ids": list(s.way_ids),
                "length_m": round(s.length_m, 1),
            }
            for s in self._matcher.off_road_stretches
        ]

    # Inside.

    def _time_to_match(self, state: VehicleState) -> bool:
        last = self._last_match_ns
        if last is not None and 0 <= state.stamp_ns - last < MATCH_PERIOD_NS:
            return False
        self._last_match_ns = state.stamp_ns
        return True

    def _speed_limit_mps(self) -> float:
        assert self._match is not None
        return self._match.directed_edge.edge.speed_limit_mps.value

    def _match_text(self) -> str:
        assert self._match is not None
        edge = self._match.directed_edge.edge
        return f"{edge.name or edge.road_class} (way {edge.way_id})"

    def _off_map(self) -> list[Instruction]:
        self._upcoming = ()
        self._passed_s_m = None
        if self.state == "off_map" or self.state == "waiting":
            return []
        self.state = "off_map"
        told: list[Instruction] = [Tell("warning", "off the map: no rounds until the car is back")]
        if self._current is not None:
            self._current = None
            told.append(UseWorld(None))
        return told

    def _arrive(self, passed: PassedJunction, mono_s: float) -> list[Instruction]:
        summary = passed.junction.summary
        told: list[Instruction] = []
        at_s = self.drive_time_s
        if self._visits.see(passed.junction, load=True, mono_s=mono_s, drive_time_s=at_s):
            told.append(BuildWorld(summary.id, load=True))
        self._visits.arrive(summary.id, mono_s=mono_s, drive_time_s=at_s)
        self._passed_s_m = passed.centre_s_m
        text = f"passed {summary.kind} {summary.name or summary.id} ({summary.control})"
        return [*told, Tell("info", text)]

    def _look_ahead(self, mono_s: float) -> None:
        assert self._progress is not None
        self._upcoming = self._follower.upcoming(FAR_AHEAD_M)
        arrivals = predict_arrivals(
            self._follower.route, self._progress.s_m, self._upcoming, self._pace
        )
        # A junction that is passed twice within sight counts with its nearer passage.
        self._arrival_in_s = {a.junction.summary.id: a.in_s for a in reversed(arrivals)}
        for ahead in self._upcoming:
            visit = self._visits.get(ahead.junction.summary.id)
            if (
                visit is not None
                and visit.arrived_at_s is None
                and visit.entered_mono_s is None
                and ahead.distance_m <= self._settings.radius_m
            ):
                visit.entered_mono_s = mono_s

    def _wanted_worlds(self, mono_s: float) -> list[Instruction]:
        wanted = [
            (ahead.junction, True)
            for ahead in self._upcoming
            if self._arrival_in_s[ahead.junction.summary.id] <= self._settings.look_ahead_s
        ]
        if not self._given or (self._progress is not None and self._progress.off_route):
            others = self._follower.alternatives(ALTERNATIVES_M)
            wanted += [(ahead.junction, False) for ahead in others]
        at_s = self.drive_time_s
        return [
            BuildWorld(junction.summary.id, load)
            for junction, load in wanted
            if self._visits.see(junction, load=load, mono_s=mono_s, drive_time_s=at_s)
        ]

    def _choose_current(self) -> list[Instruction]:
        """The junction just passed stays current for a while; then the next one within reach."""
        progress = self._progress
        if progress is None:
            return []
        if self._passed_s_m is not None:
            if progress.s_m - self._passed_s_m < KEEP_PAST_CENTRE_M and self._current is not None:
                return []
            self._passed_s_m = None
        chosen = None
        for ahead in self._upcoming:
            junction_id = ahead.junction.summary.id
            visit = self._visits.get(junction_id)
            if visit is not None and visit.usable:
                if self._arrival_in_s[junction_id] <= self._settings.look_ahead_s:
                    chosen = junction_id
                break
            if visit is not None and not visit.failed:
                break
        if chosen == self._current:
            return []
        self._current = chosen
        visit = self._visits.get(chosen) if chosen else None
        return [UseWorld(visit.world.id if visit is not None and visit.world else None)]

    def _tell_deviations(self) -> list[Instruction]:
        told: list[Instruction] = []
        assert self._progress is not None
        if self._progress.off_route != self._off_route_told:
            self._off_route_told = self._progress.off_route
            text = "left the given route; the way ahead is predicted"
            if not self._off_route_told:
                text = "back on the given route"
            told.append(Tell("warning" if self._off_route_told else "info", text))
        stretches = self._matcher.off_road_stretches
        if len(stretches) > self._stretches_told:
            self._stretches_told = len(stretches)
            last = stretches[-1]
            why = {
                "no_car_road": "which the map does not give to cars",
                "against_one_way": "against a one-way street of the map",
            }[last.reason]
            ways = ", ".join(str(way) for way in last.way_ids)
            told.append(Tell("warning", f"drives on {last.name or 'a way'} {why} (way {ways})"))
        return told
