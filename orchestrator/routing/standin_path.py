"""What the stand-in car drives: the route's lane-centre path with a speed profile it can hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import geo_from_local
from foretwin.geometry.polyline import arc_lengths
from foretwin.geometry.speed_profile import accelerated, braked, speed_in_bends_mps
from foretwin.orchestrator.routing.driving_path import driving_path
from foretwin.orchestrator.routing.route import Route
from foretwin.orchestrator.routing.route_heights import heights_along
from foretwin.world_gen.elevation.profiles import RoadProfiles
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.road_graph import RoadGraph

LATERAL_MPS2 = 2.0
ACCEL_MPS2 = 1.3
BRAKE_MPS2 = 1.8
LEAD_M = 12.0
"""Left out at both ends, so that the car neither begins nor ends on a map's last node."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StandinPath:
    """Positions (N,) in degrees and speeds (N,); speed 0 asks for a stop there."""

    lat_deg: Array
    lon_deg: Array
    speed_mps: Array
    altitude_m: Array | None = None
    """Heights (N,) of the road; None where it is flat."""

    def as_json(self) -> dict[str, Any]:
        """Return the lists that the stand-in's process reads."""
        height = self.altitude_m
        climbs = {} if height is None else {"altitude_m": [round(float(v), 3) for v in height]}
        return {
            "lat_deg": [round(float(v), 9) for v in self.lat_deg],
            "lon_deg": [round(float(v), 9) for v in self.lon_deg],
            "speed_mps": [round(float(v), 3) for v in self.speed_mps],
            **climbs,
        }


def standin_path(
    osm: OsmMap, graph: RoadGraph, route: Route, profiles: RoadProfiles | None = None
) -> StandinPath:
    """Return the path along a route: limits, slow in bends, a halt at the stop signs on its way.

    It climbs as `profiles` say.
    """
    start_m, end_m = float(route.start_m[0]) + LEAD_M, route.end_m - LEAD_M
    geometry = driving_path(route, s_from_m=start_m, s_to_m=end_m)
    stops = [int(np.searchsorted(geometry.s_m, s_m)) for s_m in stop_signs(osm, route)]
    speed = speed_profile(
        geometry.xy_m,
        geometry.speed_limit_mps,
        stop_indices=[index for index in stops if 0 < index < len(geometry.s_m)],
    )
    geo = geo_from_local(graph.frame, geometry.xy_m)
    height = None
    if profiles is not None:
        height = heights_along(route, geometry.s_m, profiles)
    return StandinPath(lat_deg=geo[:, 0], lon_deg=geo[:, 1], speed_mps=speed, altitude_m=height)


def stop_signs(osm: OsmMap, route: Route) -> list[float]:
    """Return the positions along a route of the stop signs that face its driver."""
    found = []
    for place, directed in enumerate(route.edges):
        xy = directed.xy_m
        along = arc_lengths(xy)
        nodes = directed.edge.node_ids[::-1] if directed.reverse else directed.edge.node_ids
        for node, s_m in zip(nodes[1:], along[1:], strict=True):
            tags = osm.node_tags.get(node, {})
            facing = "backward" if directed.reverse else "forward"
            if tags.get("highway") == "stop" and tags.get("direction", facing) in (facing, "both"):
                found.append(float(route.start_m[place] + s_m))
    return found


def speed_profile(xy_m: Array, limit_mps: Array, *, stop_indices: Sequence[int] = ()) -> Array:
    """Return speeds (N,) within limits (N,), lateral acceleration, and what drive and brakes give.

    Bends first, then what drive and brakes give, forwards and backwards.
    """
    step = np.hypot(*np.diff(xy_m, axis=0).T)
    heading = np.unwrap(np.arctan2(*np.diff(xy_m, axis=0).T[::-1]))
    curvature = np.zeros(len(xy_m))
    if len(xy_m) > 2:
        curvature[1:-1] = np.diff(heading) / np.maximum(0.5 * (step[1:] + step[:-1]), 1e-3)
    smooth = np.convolve(np.pad(np.abs(curvature), 3, mode="edge"), np.ones(7) / 7, mode="valid")
    speed = np.minimum(limit_mps, speed_in_bends_mps(smooth, LATERAL_MPS2))
    speed[-1] = 0.0
    speed[list(stop_indices)] = 0.0
    return braked(accelerated(speed, xy_m, ACCEL_MPS2), xy_m, BRAKE_MPS2)
