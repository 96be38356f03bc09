"""The real drive through Berlin, once for all tests: map, junctions, causal states."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from foretwin.contracts.frames import local_from_geo, local_from_geo_yaw
from foretwin.orchestrator.routing.junctions_ahead import PassedJunction
from foretwin.orchestrator.routing.map_matching import MapMatcher, Match
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_follower import RouteFollower, RouteProgress
from foretwin.telemetry.estimator.estimator import StateEstimator
from foretwin.telemetry.logs.opening import open_log
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import RoadGraph


@dataclass(frozen=True, kw_only=True)
class Drive:
    """States (N,) estimated causally, in the graph's frame; `lat_lon_deg` (N, 2) as received."""

    graph: RoadGraph
    junctions: tuple[Junction, ...]
    time_s: np.ndarray
    xy_m: np.ndarray
    lat_lon_deg: np.ndarray
    yaw_rad: np.ndarray
    yaw_valid: np.ndarray
    speed_mps: np.ndarray
    yaw_rate_radps: np.ndarray

    def until(self, time_s: float) -> int:
        """Index of the first state after `time_s`."""
        return int(np.searchsorted(self.time_s, time_s, side="right"))


@lru_cache(maxsize=1)
def berlin(data_dir: Path) -> Drive:
    osm = read_map(data_dir / "osm-berlin-mitte" / "berlin-mitte.osm")
    graph = build_road_graph(osm)
    log = open_log(data_dir / "drive-berlin-gendarmenmarkt" / "Berlin_Gendarmenmarkt_GT.txt")
    estimator = StateEstimator(log.info)
    found = [estimator.handle(channel, message) for channel, message in log.samples()]
    states = [state for state in found if state is not None]
    lat_lon = np.array([(s.position.lat_deg, s.position.lon_deg) for s in states])
    return Drive(
        graph=graph,
        junctions=find_intersections(osm, graph),
        time_s=np.array([(s.stamp_ns - log.info.start_stamp_ns) / 1e9 for s in states]),
        xy_m=local_from_geo(graph.frame, lat_lon[:, 0], lat_lon[:, 1]),
        lat_lon_deg=lat_lon,
        yaw_rad=local_from_geo_yaw(
            graph.frame, np.array([s.yaw_rad for s in states]), lat_lon[:, 0], lat_lon[:, 1]
        ),
        yaw_valid=np.array([s.yaw_valid for s in states]),
        speed_mps=np.array([s.speed_mps for s in states]),
        yaw_rate_radps=np.array([s.yaw_rate_radps for s in states]),
    )


@dataclass(frozen=True, kw_only=True)
class Replayed:
    """What matcher and follower said at each state up to the end of the replay."""

    matches: list[Match | None]
    progress: list[RouteProgress | None]
    upcoming: list[list[tuple[str, float]]]
    passed: list[tuple[float, PassedJunction]]
    matcher: MapMatcher


def replay(drive: Drive, until_s: float, given: tuple[Route, ...] = ()) -> Replayed:
    matcher = MapMatcher(drive.graph)
    follower = RouteFollower(drive.graph, drive.junctions, given)
    result = Replayed(matches=[], progress=[], upcoming=[], passed=[], matcher=matcher)
    for i in range(drive.until(until_s)):
        match = matcher.update(
            drive.xy_m[i],
            float(drive.yaw_rad[i]),
            bool(drive.yaw_valid[i]),
            float(drive.speed_mps[i]),
        )
        progress = follower.update(match)
        result.matches.append(match)
        result.progress.append(progress)
        if progress is not None:
            result.passed.extend((float(drive.time_s[i]), passed) for passed in progress.passed)
        result.upcoming.append(
            [(a.junction.summary.id, a.distance_m) for a in follower.upcoming(400.0)]
            if progress is not None
            else []
        )
    return result
