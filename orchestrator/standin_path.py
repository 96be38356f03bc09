"""What the stand-in car drives: the route's lane-centre path with a speed profile it can hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contracts.arrays import Array
from contracts.frames import geo_from_local
from orchestrator.driving_path import driving_path
from orchestrator.route import Route
from world_gen.intersections import Junction
from world_gen.road_graph import RoadGraph

LATERAL_MPS2 = 2.0
ACCEL_MPS2 = 1.3
BRAKE_MPS2 = 1.8
STOP_BEFORE_CENTRE_M = 9.0
LEAD_M = 12.0
"""Left out at both ends, so that the car neither begins nor ends on a map's last node."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StandinPath:
    """Positions (N,) in degrees and speeds (N,); speed 0 asks for a stop there."""

    lat_deg: Array
    lon_deg: Array
    speed_mps: Array

    def as_json(self) -> dict[str, Any]:
        """Return the lists that the stand-in's process reads."""
        return {
            "lat_deg": [round(float(v), 9) for v in self.lat_deg],
            "lon_deg": [round(float(v), 9) for v in self.lon_deg],
            "speed_mps": [round(float(v), 3) for v in self.speed_mps],
        }


def standin_path(
    graph: RoadGraph, route: Route, junctions: Sequence[Junction], *, end_s: float | None = None
) -> StandinPath:
    """Return the path along a route: limits, slow in bends, a halt where junctions ask for it."""
    start_m, end_m = float(route.start_m[0]) + LEAD_M, route.end_m - LEAD_M
    geometry = driving_path(graph, route, s_from_m=start_m, s_to_m=end_m)
    stops = [
        _nearest_index(geometry.xy_m, junction.centre_xy_m, STOP_BEFORE_CENTRE_M)
        for junction in junctions
        if junction.summary.control in ("stop", "all_way_stop")
    ]
    speed = speed_profile(
        geometry.xy_m,
        geometry.speed_limit_mps,
        stop_indices=[index for index in stops if index is not None],
    )
    geo = geo_from_local(graph.frame, geometry.xy_m)
    return StandinPath(lat_deg=geo[:, 0], lon_deg=geo[:, 1], speed_mps=speed)


def _nearest_index(xy_m: Array, centre_xy_m: Array, before_m: float) -> int | None:
    """Return the point `before_m` ahead of where the path passes a centre, None if it does not."""
    away = np.hypot(*(xy_m - centre_xy_m).T)
    nearest = int(np.argmin(away))
    if away[nearest] > 10.0:
        return None
    steps = np.hypot(*np.diff(xy_m[: nearest + 1], axis=0).T)[::-1]
    ahead = int(np.searchsorted(np.cumsum(steps), before_m))
    return nearest - ahead if nearest > ahead else None


def speed_profile(xy_m: Array, limit_mps: Array, *, stop_indices: Sequence[int] = ()) -> Array:
    """Return speeds (N,) within limits (N,), lateral acceleration, and what drive and brakes give.

    v² ≤ a_lat/|κ|, then v² ≤ v₀² + 2·a·Δs forwards and backwards (the usual two-pass profile).
    """
    step = np.hypot(*np.diff(xy_m, axis=0).T)
    heading = np.unwrap(np.arctan2(*np.diff(xy_m, axis=0).T[::-1]))
    curvature = np.zeros(len(xy_m))
    if len(xy_m) > 2:
        curvature[1:-1] = np.diff(heading) / np.maximum(0.5 * (step[1:] + step[:-1]), 1e-3)
    smooth = np.convolve(np.pad(np.abs(curvature), 3, mode="edge"), np.ones(7) / 7, mode="valid")
    speed = np.minimum(limit_mps, np.sqrt(LATERAL_MPS2 / np.maximum(smooth, 1e-4)))
    speed[-1] = 0.0
    speed[list(stop_indices)] = 0.0
    for index in range(1, len(speed)):
        speed[index] = min(
            speed[index], np.sqrt(speed[index - 1] ** 2 + 2 * ACCEL_MPS2 * step[index - 1])
        )
    for index in range(len(speed) - 2, -1, -1):
        speed[index] = min(
            speed[index], np.sqrt(speed[index + 1] ** 2 + 2 * BRAKE_MPS2 * step[index])
        )
    return speed
