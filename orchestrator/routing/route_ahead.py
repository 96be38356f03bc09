"""Where the car is on the map and what lies ahead of it: junctions, arrival times, the path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import local_from_geo, local_from_geo_yaw, target_from_source_m
from foretwin.contracts.futures import PATH_BEHIND_M, PathAhead
from foretwin.contracts.trace import traced
from foretwin.contracts.tracks import DrivenTrack
from foretwin.contracts.world import World
from foretwin.orchestrator.routing.arrival import (
    STRAIGHT,
    Arrival,
    BendSpeeds,
    Countdown,
    DrivingPace,
    predict_arrivals,
)
from foretwin.orchestrator.routing.cruise import CruiseSpeed
from foretwin.orchestrator.routing.driven_speeds import DrivenSpeeds
from foretwin.orchestrator.routing.driving_path import SPACING_M, driving_path
from foretwin.orchestrator.routing.going_on import stands
from foretwin.orchestrator.routing.junctions_ahead import PassedJunction, UpcomingJunction
from foretwin.orchestrator.routing.lane_chain import LaneGuide
from foretwin.orchestrator.routing.map_matching import MapMatcher, Match, OffRoadStretch
from foretwin.orchestrator.routing.road_index import RoadIndex, legality
from foretwin.orchestrator.routing.road_line import RoadLines
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_follower import PlaceOnRoute, RouteFollower, RouteProgress
from foretwin.orchestrator.routing.speed_ahead import WaySpeeds, speeds_ahead, way_speeds
from foretwin.orchestrator.routing.world_lanes import WorldLanes
from foretwin.telemetry.estimator.map_aid import RoadLine
from foretwin.world_gen.extent import extent_of
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.roads.road_graph import RoadGraph
from foretwin.world_gen.roads.turn_restrictions import UNRESTRICTED, TurnRestrictions

FAR_AHEAD_M = 3000.0
ALTERNATIVES_M = 300.0
"""How far ahead other turns than the predicted ones are looked down."""
PATH_SPARE_M = 60.0
MIN_PATH_M = 20.0


class WayAhead:
    """Follows the car through the road graph; everything it says is for the latest state."""

    def __init__(
        self,
        graph: RoadGraph,
        junctions: tuple[Junction, ...],
        routes: tuple[Route, ...],
        *,
        index: RoadIndex | None = None,
        tracks: Sequence[DrivenTrack] = (),
        restrictions: TurnRestrictions = UNRESTRICTED,
    ) -> None:
        """`tracks` are of earlier drives, whose speeds the nominal future then heeds;
        `restrictions` are those that a way without a route keeps to."""
        index = index or RoadIndex(graph)
        self._graph = graph
        self._matcher = MapMatcher(graph, index=index)
        self._follower = RouteFollower(
            graph, junctions, routes, index=index, restrictions=restrictions
        )
        self._lines = RoadLines(graph)
        self._pace = DrivingPace()
        self._cruise = CruiseSpeed()
        self._earlier = DrivenSpeeds(tracks, graph.frame) if tracks else None
        self._given = bool(routes)
        self._match: Match | None = None
        self._progress: RouteProgress | None = None
        self._xy_m: Array = np.zeros(2)
        self._stamp_ns = 0
        self._lanes: WorldLanes | None = None
        self._speeds: WaySpeeds | None = None
        """Of the latest round's path, until the next one."""
        self._bends: BendSpeeds = STRAIGHT
        self._countdown = Countdown()
        self.off_lanes_m = 0.0
        """So much of the latest path is driven in its World along none of its lanes."""
        self.junctions: tuple[Arrival, ...] = ()

    def give(self, route: Route) -> None:
        """Follow this route from the next state on."""
        self._given = True
        self._follower.give((route,))

    def take_speed(self, state: VehicleState) -> None:
        """Learn from a state how the car is driven."""
        self._cruise.update(state.stamp_ns, state.speed_mps)

    @traced("locate on the map")
    def locate(self, state: VehicleState) -> tuple[PassedJunction, ...] | None:
        """Find the car on the map; returns the junctions just passed, None off the map."""
        lat, lon = state.position.lat_deg, state.position.lon_deg
        self._stamp_ns = state.stamp_ns
        xy = self._xy_m = local_from_geo(self._graph.frame, lat, lon)
        yaw = float(local_from_geo_yaw(self._graph.frame, state.yaw_rad, lat, lon))
        self._match = self._matcher.update(xy, yaw, state.yaw_valid, state.speed_mps)
        self._progress = self._follower.update(self._match)
        if self._progress is None:
            self.junctions = ()
            self._countdown.update(state.stamp_ns, None, waiting=False)
            return None
        self._pace.update(state.stamp_ns, state.speed_mps, self.speed_limit_mps)
        acceleration_mps2 = self._cruise.acceleration_mps2
        upcoming: tuple[UpcomingJunction, ...] = self._follower.upcoming(FAR_AHEAD_M)
        self.junctions = predict_arrivals(
            self._follower.route,
            self._progress.s_m,
            upcoming,
            self._pace,
            acceleration_mps2=acceleration_mps2,
            bends=self._bends,
        )
        next_one = self.junctions[0] if self.junctions else None
        waiting = stands(self._cruise.speed_mps, acceleration_mps2)
        self._countdown.update(state.stamp_ns, next_one, waiting=waiting)
        return self._progress.passed

    @traced("road line")
    def road_line(self, state: VehicleState) -> RoadLine | None:
        """Return the line that a state just located drives along, None where it is in doubt."""
        if self._match is None or self._progress is None or not state.yaw_valid:
            return None
        xy = local_from_geo(self._graph.frame, state.position.lat_deg, state.position.lon_deg)
        route, s_m, roads_near = self._follower.route, self._progress.s_m, self._matcher.roads_near
        return self._lines.near(state, xy, self._match, route, s_m, roads_near=roads_near)

    @property
    def s_m(self) -> float:
        """The car's position along its route."""
        assert self._progress is not None
        return self._progress.s_m

    @property
    def place(self) -> PlaceOnRoute:
        """Where on its route the car was last."""
        return self._follower.place

    def go_on(self, place: PlaceOnRoute) -> None:
        """Look for the car from a place on its route on; before the first state."""
        self._follower.go_on(place)

    @property
    def off_route(self) -> bool:
        """Whether a route is given and the car is not on it."""
        return self._progress is not None and self._progress.off_route

    @property
    def other_turns(self) -> tuple[Junction, ...]:
        """Junctions near ahead that turns lead to which are not expected, where those may come."""
        if self._progress is None or (self._given and not self._progress.off_route):
            return ()
        return tuple(a.junction for a in self._follower.alternatives(ALTERNATIVES_M))

    @property
    def road_text(self) -> str:
        """The road that the car is on, for people."""
        assert self._match is not None
        edge = self._match.directed_edge.edge
        return f"{edge.name or edge.road_class} (way {edge.way_id})"

    @property
    def speed_limit_mps(self) -> float:
        """The limit of the road that the car is on."""
        assert self._match is not None
        return self._match.directed_edge.speed_limit_mps.value

    @property
    def usual_speed_mps(self) -> float:
        """What the driver is taken to drive here where nothing is in the way."""
        return self._pace.share * self.speed_limit_mps

    @property
    def cruise_speed_mps(self) -> float:
        """The speed that the nominal future aims at."""
        return self._cruise.aim_mps(self.speed_limit_mps)

    @property
    def acceleration_mps2(self) -> float:
        """The trend of the speed over the last second."""
        return self._cruise.acceleration_mps2

    @property
    def countdown_s(self) -> float | None:
        """The seconds until the next junction, for people; None while the car stands."""
        return self._countdown.in_s

    @traced("speeds of a round")
    def speeds_ahead(self, *, horizon_s: float) -> Array:
        """Return (K,) what the nominal future is to drive along the latest path, from instant to
        instant."""
        assert self._speeds is not None
        return speeds_ahead(
            self._speeds,
            speed_mps=self._cruise.speed_mps,
            acceleration_mps2=self._cruise.acceleration_mps2,
            usual_share=self._pace.share,
            horizon_s=horizon_s,
        )

    @property
    def bend_accel_mps2(self) -> float:
        """What the driver takes across the latest path in its bends."""
        assert self._speeds is not None
        return self._speeds.bend_accel_mps2

    @property
    def closed_to_cars(self) -> bool:
        """Whether the car is on a way that the map has, but gives to no car."""
        return self._match is not None and legality(self._match.directed_edge) == "no_car_road"

    @property
    def off_road_stretches(self) -> tuple[OffRoadStretch, ...]:
        """Stretches driven where the map says that cars may not."""
        return self._matcher.off_road_stretches

    @traced("path of a round")
    def path(self, world: World, *, speed_mps: float, horizon_s: float) -> PathAhead | None:
        """Return the way ahead in a World's frame; None where the road ends within a few metres.

        Along the World's lanes, and beyond them in the lane that the road's tags make likely. Long
        enough for a car that speeds up by 8 m/s over the horizon.
        """
        if self._follower.route.end_m - self.s_m < MIN_PATH_M:
            return None
        reach_m = horizon_s * max(speed_mps + 8.0, 15.0) + PATH_SPARE_M
        if self._lanes is None or self._lanes.world_id != world.id:
            self._lanes = WorldLanes(world, self._graph)
        route = self._follower.route
        guide = LaneGuide(self._lanes, route, car_s_m=self.s_m, car_xy_m=self._xy_m)
        geometry = driving_path(
            route,
            s_from_m=self.s_m - PATH_BEHIND_M,
            s_to_m=self.s_m + reach_m,
            onto_lanes=guide.onto_lanes,
        )
        xy = target_from_source_m(world.frame, self._graph.frame, geometry.xy_m)
        off_lanes = extent_of(world).holds(xy) & guide.without_lanes(geometry.s_m)
        self.off_lanes_m = SPACING_M * int(np.count_nonzero(off_lanes))
        path = PathAhead(xy_m=xy, speed_limit_mps=geometry.speed_limit_mps)
        driven_mps = None
        if self._earlier is not None:
            driven_mps = self._earlier.along(
                geometry.xy_m, stamp_ns=self._stamp_ns, car_xy_m=self._xy_m
            )
        self._speeds = way_speeds(path, driven_mps, speed_mps=self._cruise.speed_mps)
        self._bends = BendSpeeds(self.s_m, np.array(self._speeds.bend_mps))
        return path
