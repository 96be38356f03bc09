"""Worlds and jobs for the benchmarks of futures: a curved street, bare or lined with buildings."""

from __future__ import annotations

import math

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.futures import Future, Job, PathAhead
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import Area, IntersectionSummary, World

FUTURES = 64
HORIZON_S = 8.0
SPEED_MPS = 10.0
CONTROL_HZ = 20.0

_ORIGIN = GeoPoint(45.0, -30.0)
_CURVE_RADIUS_M = 80.0
_HALF_ROAD_M = 4.0


def street(*, buildings: int) -> World:
    """Return a World of nothing but `buildings` boxes beside the path of `path_ahead`."""
    count = buildings // 2
    along = np.linspace(-30.0, 230.0, count) if count else np.empty(0)
    boxes = [_box(f"b{side}{i}", s, side * 22.0) for i, s in enumerate(along) for side in (-1, 1)]
    # Workers leave out what no road comes near: without a road, all of it.
    kerbs = np.concatenate(
        [_beside(np.arange(-35.0, 240.0, 5.0), side)[::side] for side in (1, -1)]
    )
    return World(
        id=f"street-{buildings}",
        intersection=IntersectionSummary(
            id="street", kind="other", lat=_ORIGIN.lat_deg, lon=_ORIGIN.lon_deg, arms=2,
            control="uncontrolled", driving_side="right", osm_nodes=(),
        ),
        frame=LocalFrame(_ORIGIN),
        radius_m=250.0,
        map_sha256="",
        lanes=(),
        connections=(),
        stop_lines=(),
        crossings=(),
        signals=(),
        islands=(),
        kerbs=(),
        road_surface=(Area(id="road", outline=kerbs[::-1]),),
        buildings=tuple(boxes),
        attribution="drawn for a benchmark",
    )  # fmt: skip


def job(world: World, futures: tuple[Future, ...]) -> Job:
    """Return a job of `futures` that starts on the street at 10 m/s."""
    state = VehicleState(
        vehicle_id="ego", stamp_ns=0, position=_ORIGIN, yaw_rad=0.0, speed_mps=SPEED_MPS,
        yaw_rate_radps=0.0, accel_mps2=0.0, tire_angle_rad=0.0,
    )  # fmt: skip
    along_m = np.arange(-10.0, 240.0)
    xy_m, _ = _path(along_m)
    return Job(
        round_id=1,
        job_index=0,
        world_id=world.id,
        state=state,
        path=PathAhead(xy_m=xy_m, speed_limit_mps=np.full(len(along_m), 14.0)),
        futures=futures,
        horizon_s=HORIZON_S,
        step_s=0.1,
        seed=0,
        cruise_speed_mps=SPEED_MPS,
    )


def without_road_users(futures: tuple[Future, ...]) -> tuple[Future, ...]:
    """Return the same futures with nobody else on the road."""
    return tuple(msgspec.structs.replace(future, scenario_id="") for future in futures)


def _path(along_m: Array) -> tuple[Array, Array]:
    """Return points (N, 2) and yaws (N,) of a path: 60 m straight, then a wide left curve."""
    turned = np.maximum(along_m - 60.0, 0.0) / _CURVE_RADIUS_M
    x_m = np.minimum(along_m, 60.0) + _CURVE_RADIUS_M * np.sin(turned)
    y_m = _CURVE_RADIUS_M * (1.0 - np.cos(turned))
    return np.stack([x_m, y_m], axis=-1), turned


def _beside(along_m: Array, side: int) -> Array:
    xy_m, yaw_rad = _path(along_m)
    return xy_m + side * _HALF_ROAD_M * np.stack([-np.sin(yaw_rad), np.cos(yaw_rad)], axis=-1)


def _box(name: str, along_m: float, aside_m: float) -> Building:
    (point,), (yaw_rad,) = _path(np.array([along_m]))
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    turn = np.array([[cos, -sin], [sin, cos]])
    corners = np.array([[-0.9, -5.0], [0.9, -5.0], [0.9, 5.0], [-0.9, 5.0]])
    outline = point + (corners + np.array([0.0, aside_m])) @ turn.T
    return Building(id=name, outline=outline, holes=(), height_m=Quantity(9.0, "default"))
