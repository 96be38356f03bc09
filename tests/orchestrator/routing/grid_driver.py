"""A driver on the drawn grid whom a follower follows."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.frames import geo_from_local
from foretwin.orchestrator.routing.line_matching import match_line
from foretwin.orchestrator.routing.map_matching import MapMatcher
from foretwin.orchestrator.routing.road_index import RoadIndex
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_follower import RouteFollower, RouteProgress
from foretwin.world_gen.roads.turn_restrictions import UNRESTRICTED, TurnRestrictions
from tests.orchestrator.grid_map import drive, grid, headings, junctions

TOWN = grid(5, 4)
JUNCTIONS = junctions(TOWN)
INDEX = RoadIndex(TOWN)


class Driver:
    """Drives a follower along positions and keeps what it said."""

    def __init__(
        self, given: tuple[Route, ...] = (), *, restrictions: TurnRestrictions = UNRESTRICTED
    ) -> None:
        self.matcher = MapMatcher(TOWN, index=INDEX)
        self.follower = RouteFollower(
            TOWN, JUNCTIONS, given, index=INDEX, restrictions=restrictions
        )
        self.progress: list[RouteProgress | None] = []
        self.passed: list[tuple[str, float, float]] = []

    def go(self, corners: list[tuple[float, float]]) -> Driver:
        xy = drive(corners)
        for point, yaw in zip(xy, headings(xy), strict=True):
            now = self.follower.update(self.matcher.update(point, yaw, True, 8.0))
            self.progress.append(now)
            if now is not None:
                self.passed += [(p.junction.summary.id, *point) for p in now.passed]
        return self

    @property
    def names(self) -> list[str]:
        return [name for name, _, _ in self.passed]

    def ahead(self, horizon_m: float = 500.0) -> list[tuple[str, int]]:
        return [
            (ahead.junction.summary.id, round(ahead.distance_m))
            for ahead in self.follower.upcoming(horizon_m)
        ]


def route_of(corners: list[tuple[float, float]]) -> tuple[Route, ...]:
    lat_lon_deg = np.asarray(geo_from_local(TOWN.frame, drive(corners)))
    return match_line(TOWN, lat_lon_deg, index=INDEX).routes
