"""The route that a live vehicle says it drives, as the route of the drive."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.bus import Bus, Mailbox, Received
from foretwin.contracts.drive import PlannedTrajectory, RouteToGoal, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import local_from_geo
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.rounds.jobs import PLAN_FRESH_NS
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_to_goal import FoundWay, WayFinder, away_m
from foretwin.world_gen.roads.turn_restrictions import read_turn_restrictions

LOOK_EVERY_NS = 1_000_000_000
PLAN_AWAY_M = 25.0
"""A plan that ends farther from the route leads elsewhere."""


class RouteHandler:
    """Finds the way to the vehicle's goal, and hands it on; one thread does the looking.

    A large map takes a second to search, and nothing may hold up a live drive.
    """

    def __init__(
        self, plan: DrivePlan, *, use: Callable[[Route], None], tell: Callable[[Notice], None]
    ) -> None:
        """`use` takes each route that was found; without `--route live` there is nothing to do."""
        self._osm, self._graph, self._vehicle_id = plan.osm, plan.graph, plan.config.vehicle_id
        self._use, self._tell = use, tell
        self._live = plan.config.route == "live"
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="route")
        self._finder: Future[WayFinder] | None = None
        self._said: RouteToGoal | None = None
        self._looking: Future[FoundWay] | None = None
        self._wanted = False
        self._route: Route | None = None
        self._looked_ns = 0

    def join(self, bus: Bus, mailbox: Mailbox) -> None:
        """Listen to the vehicle, and make ready for its word."""
        if self._live:
            bus.subscribe("route", mailbox, vehicle=self._vehicle_id)
            # An index of its own: its memory of what is reachable is not for two threads.
            self._finder = self._thread.submit(self._make_finder)

    def _make_finder(self) -> WayFinder:
        return WayFinder(RoadIndex(self._graph), read_turn_restrictions(self._osm, self._graph))

    def take(self, item: Received) -> None:
        """Take what the vehicle says; the same again changes nothing.

        Raises Refused where the guard does not let it in.
        """
        said = item.message()
        if self._said is None or (said.start, said.goal) != (self._said.start, self._said.goal):
            self._said, self._route, self._wanted = said, None, True

    def keep_up_with(self, state: VehicleState, plan: PlannedTrajectory | None) -> None:
        """Hand on what was found, and look anew where the vehicle's plan leads elsewhere."""
        if self._looking is not None and self._looking.done():
            found, self._looking = self._looking, None
            if not self._wanted:
                self._take_found(found)
        if self._said is None or self._looking is not None:
            return
        fresh = plan is not None and abs(state.stamp_ns - plan.stamp_ns) <= PLAN_FRESH_NS
        line_deg = _line(plan) if fresh and plan is not None else None
        if not self._wanted:
            if abs(state.stamp_ns - self._looked_ns) < LOOK_EVERY_NS or line_deg is None:
                return
            self._looked_ns = state.stamp_ns
            self._wanted = self._leads_elsewhere(line_deg)
        if self._wanted:
            self._wanted, self._looked_ns = False, state.stamp_ns
            said, finder = self._said, self._finder
            assert finder is not None
            self._looking = self._thread.submit(
                lambda: finder.result().find(said.start, said.goal, planned_deg=line_deg)
            )

    def close(self) -> None:
        """Let the thread end; idempotent."""
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _take_found(self, looked: Future[FoundWay]) -> None:
        assert self._said is not None
        try:
            found = looked.result()
        except UserError as error:
            text = f"the vehicle's route cannot be used: {error}; the way ahead is predicted"
            self._tell(Notice("warning", text))
            return
        first = self._route is None
        self._route = found.route
        goal = self._said.goal.position
        length_m = found.route.end_m - found.route.origin_m
        how = "the shortest way"
        if found.planned_m > 0.0:
            how = f"the first {min(found.planned_m, length_m):.0f} m as it plans, then {how}"
        text = (
            f"route of the vehicle {'taken' if first else 'follows its plan'}: "
            f"{length_m / 1000.0:.1f} km to {goal.lat_deg:.5f}, {goal.lon_deg:.5f}, {how} on this "
            f"map: its {self._said.segments} lanelets say nothing without their own"
        )
        self._tell(Notice("info", text))
        self._use(found.route)

    def _leads_elsewhere(self, line_deg: Array) -> bool:
        if self._route is None:
            return False
        xy_m = local_from_geo(self._graph.frame, line_deg[-1:, 0], line_deg[-1:, 1])[0]
        return away_m(self._route, xy_m) > PLAN_AWAY_M


def _line(plan: PlannedTrajectory) -> Array | None:
    line = np.stack([plan.lat_deg, plan.lon_deg], axis=1)
    return line if len(line) >= 2 and bool(np.isfinite(line).all()) else None
