"""Small Worlds and paths that the tests of this folder drive on."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, geo_from_local_yaw
from foretwin.contracts.futures import Future, Job, PathAhead
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import (
    Area,
    Connection,
    IntersectionSummary,
    Lane,
    World,
    WorldJunction,
)
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.reading import catalogue

FRAME = LocalFrame(GeoPoint(52.5, 13.4))


def box(x: float, y: float, half_x: float, half_y: float, name: str = "b") -> Building:
    outline = np.array(
        [[x - half_x, y - half_y], [x + half_x, y - half_y], [x + half_x, y + half_y],
         [x - half_x, y + half_y]]
    )  # fmt: skip
    return Building(id=name, outline=outline, holes=(), height_m=Quantity(8.0, "default"))


def _lane(name: str, line: Array) -> Lane:
    return Lane(
        id=name, osm_way=1, name="", kind="driving", centerline=line,
        width_m=Quantity(3.0, "default"), speed_limit_mps=Quantity(13.9, "default"), role="other",
    )  # fmt: skip


def _street(name: str, half_x: float, half_y: float) -> Area:
    return Area(id=name, outline=box(0.0, 0.0, half_x, half_y).outline)


def crossroads(*, buildings: tuple[Building, ...] = (), connections: bool = True) -> World:
    """Two streets that cross at the origin, with straight connections from all four sides."""
    lanes, links = [], []
    for name, angle in (("east", 0.0), ("north", 90.0), ("west", 180.0), ("south", 270.0)):
        way = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
        right = 1.5 * np.array([way[1], -way[0]])
        arc = np.arange(8.0, 141.0, 4.0)[:, None]
        lanes.append(_lane(f"from_{name}", right - arc[::-1] * way))
        lanes.append(_lane(f"to_{name}", right + arc * way))
        links.append(
            Connection(
                id=name, from_lane_id=f"from_{name}", to_lane_id=f"to_{name}", turn="straight",
                centerline=right + np.linspace(-8.0, 8.0, 9)[:, None] * way,
                width_m=Quantity(3.0, "default"), junction_id="i1",
                conflicts_with=("north", "south") if angle % 180.0 == 0.0 else ("east", "west"),
            )
        )  # fmt: skip
    summary = IntersectionSummary(
        id="i1", kind="crossing", lat=52.5, lon=13.4, arms=4, control="uncontrolled",
        driving_side="right", osm_nodes=(1,),
    )  # fmt: skip
    return World(
        id="crossroads", frame=FRAME, radius_m=150.0, map_sha256="0" * 64,
        intersection=summary,
        junctions=(WorldJunction(summary=summary, arms=(), area=None),),
        lanes=tuple(lanes), connections=tuple(links) if connections else (), stop_lines=(),
        crossings=(), signals=(), islands=(), kerbs=(),
        road_surface=(_street("ew", 150.0, 4.0), _street("ns", 4.0, 150.0)),
        buildings=buildings,
    )  # fmt: skip


def straight_path(*, from_x: float = -60.0, to_x: float = 120.0, y: float = -1.5) -> PathAhead:
    x = np.arange(from_x, to_x, 1.0)
    return PathAhead(
        xy_m=np.stack([x, np.full_like(x, y)], 1), speed_limit_mps=np.full(len(x), 13.9)
    )


def turning_path(*, radius_m: float = 12.0) -> PathAhead:
    """East along y = -1.5, then left to the north."""
    turn = np.linspace(0.0, math.pi / 2, 20)[1:]
    start = np.stack([np.arange(-60.0, 0.0, 1.0), np.full(60, -1.5)], 1)
    arc = np.stack([radius_m * np.sin(turn), radius_m * (1 - np.cos(turn)) - 1.5], 1)
    up = np.arange(1.0, 120.0)
    end = np.stack([np.full(len(up), radius_m), radius_m - 1.5 + up], 1)
    xy = np.concatenate([start, arc, end])
    return PathAhead(xy_m=xy, speed_limit_mps=np.full(len(xy), 13.9))


def state_at(
    x: float, y: float, yaw: float = 0.0, speed: float = 8.0, *, stamp_ns: int = 0,
    yaw_rate: float = 0.0, tire_angle: float | None = 0.0, accel: float = 0.0,
) -> VehicleState:  # fmt: skip
    lat, lon = geo_from_local(FRAME, np.array([x, y]))
    return VehicleState(
        vehicle_id="car", stamp_ns=stamp_ns, position=GeoPoint(float(lat), float(lon)),
        yaw_rad=float(geo_from_local_yaw(FRAME, yaw, np.array([x, y]))), speed_mps=speed,
        yaw_rate_radps=yaw_rate, accel_mps2=accel, tire_angle_rad=tire_angle,
    )  # fmt: skip


def happening(
    index: int, scenario_id: str, *, planner: str = "pure_pursuit_idm", **values: float
) -> Future:
    """A future in which a scenario of the catalogue happens; `values` with __ for the dots."""
    case = dict(draw_cases(catalogue()[scenario_id])[0])
    case.update({name.replace("__", "."): value for name, value in values.items()})
    return Future(
        index=index, name=scenario_id, planner=planner, scenario_id=scenario_id, values=case
    )


def job(
    futures: tuple[Future, ...], *, state: VehicleState | None = None,
    path: PathAhead | None = None, cruise: float = 8.0, horizon_s: float = 8.0,
    accidents: bool = False,
) -> Job:  # fmt: skip
    return Job(
        round_id=1, job_index=0, world_id="crossroads",
        state=state_at(-50.0, -1.5) if state is None else state,
        path=straight_path() if path is None else path,
        futures=futures, horizon_s=horizon_s, step_s=0.1, seed=0, cruise_speed_mps=cruise,
        scenarios=tuple(catalogue()[i] for i in sorted({v.scenario_id for v in futures} - {""})),
        accidents=accidents,
    )  # fmt: skip
