"""Drives planners on open ground, tick by tick, among road users that keep their speed."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.planner_interface import (
    Planner,
    PlannerView,
    RemembersWithinJob,
    SeenUsers,
)
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

TICK_S = 0.05


class Other(NamedTuple):
    """Somebody who keeps a speed along a line, from an arc length of it on."""

    line: Array
    speed_mps: float
    from_m: float = 0.0
    size_m: tuple[float, float] = (4.5, 1.8)
    walks: bool = False

    def at(self, time_s: float) -> Array:
        arc = np.array([self.from_m + self.speed_mps * time_s])
        pose = _path(self.line.tobytes()).pose_at(arc)
        return np.array([*pose.xy_m[0], pose.yaw_rad[0]])


def walker(line: Array, speed_mps: float, from_m: float = 0.0) -> Other:
    return Other(line, speed_mps, from_m, (0.5, 0.5), True)


@functools.lru_cache(maxsize=64)
def _path(points: bytes) -> FrenetPath:
    return FrenetPath(np.frombuffer(points).reshape(-1, 2), before_m=200.0)


@functools.cache
def _stage(vehicle_name: str, count: int) -> BatchSimulation:
    return BatchSimulation(None, load_vehicle(), nsim=count)


class Drive(NamedTuple):
    """`states` (S, T + 1, 8); `clearance_m` (S, T + 1) to the nearest other, infinite for none;
    `arc_m`, `offset_m` and `front_m` (S, T + 1) on the path."""

    states: Array
    clearance_m: Array
    arc_m: Array
    offset_m: Array
    front_m: Array

    @property
    def time_s(self) -> Array:
        return TICK_S * np.arange(self.states.shape[1])

    def first_s(self, arc_m: float, row: int = 0) -> float:
        """When the front first passes an arc length; infinite if never."""
        passed = self.front_m[row] >= arc_m
        return float(self.time_s[passed.argmax()]) if passed.any() else np.inf


def at_rest_on(path: FrenetPath, arc_m: float, speed_mps: float = 0.0, count: int = 1) -> Array:
    pose = path.pose_at(np.array([arc_m]))
    states = np.zeros((count, 8))
    states[:, :2], states[:, 2], states[:, 3] = pose.xy_m[0], pose.yaw_rad[0], speed_mps
    return states


def see(
    path: FrenetPath, others: list[Other], time_s: float, count: int
) -> tuple[SeenUsers, Array]:
    """What each of `count` cars sees of the same others, and where these (R, 3) are."""
    seen, poses = see_each(path, [others] * count, time_s)
    return seen, poses[0]


def see_each(
    path: FrenetPath, others: Sequence[list[Other]], time_s: float
) -> tuple[SeenUsers, Array]:
    """What each car sees of others of its own, R for each, and where these (S, R, 3) are."""
    known = list({id(other): other for row in others for other in row}.values())
    number = {id(other): i for i, other in enumerate(known)}
    which = np.array([[number[id(other)] for other in row] for row in others])
    poses = np.array([other.at(time_s) for other in known])
    place = path.locate(poses[:, :2])
    turned = wrap_angle(poses[:, 2] - path.pose_at(place.arc_m).yaw_rad)
    seen = SeenUsers(
        poses=poses[which],
        speed_mps=np.array([other.speed_mps for other in known])[which],
        size_m=np.array([other.size_m for other in known])[which],
        arc_m=place.arc_m[which],
        offset_m=place.offset_m[which],
        walks=np.array([other.walks for other in known])[which],
        turned_rad=turned[which],
    )
    return seen, poses[which]


def lead_of(
    seen: SeenUsers | None, arc_m: Array, offset_m: Array, vehicle: VehicleParameters
) -> tuple[Array, Array]:
    count = len(arc_m)
    if seen is None:
        return np.full(count, np.inf), np.zeros(count)
    cos, sin = np.abs(np.cos(seen.turned_rad)), np.abs(np.sin(seen.turned_rad))
    length, width = seen.size_m[..., 0], seen.size_m[..., 1]
    front = vehicle.length_m.value - vehicle.rear_overhang_m.value
    gap = seen.arc_m - arc_m[:, None] - front - 0.5 * (length * cos + width * sin)
    beside = 0.5 * (length * sin + width * cos + vehicle.width_m.value) + 0.3
    in_way = np.abs(seen.offset_m - offset_m[:, None]) < beside
    in_way &= gap > -vehicle.length_m.value
    gap = np.where(in_way, gap, np.inf)
    nearest, rows = gap.argmin(axis=1), np.arange(count)
    speed = seen.speed_mps[rows, nearest] * np.cos(seen.turned_rad[rows, nearest])
    return gap[rows, nearest], np.where(np.isfinite(gap[rows, nearest]), speed, 0.0)


def view_of(
    path: FrenetPath, states: Array, vehicle: VehicleParameters, *, time_s: float = 0.0,
    near_arc_m: Array | None = None, target_mps: Any = 8.0, **fields: Any,
) -> PlannerView:  # fmt: skip
    """What a planner sees with nobody else on the road, but for `fields`."""
    count = len(states)
    place = path.locate(states[:, :2], near_arc_m=near_arc_m)
    view = PlannerView(
        time_s=time_s, states=states, path=path, arc_m=place.arc_m, offset_m=place.offset_m,
        desired_offset_m=np.zeros(count), target_speed_mps=np.broadcast_to(target_mps, count) + 0.0,
        speed_factor=np.ones(count), lead_gap_m=np.full(count, np.inf),
        lead_speed_mps=np.zeros(count), vehicle=vehicle,
    )  # fmt: skip
    return view._replace(**fields)


def drive(
    planner: Planner, path: FrenetPath, starts: Array, *, vehicle: VehicleParameters,
    seconds: float, others: list[Other] | None = None,
    others_of: Sequence[list[Other]] | None = None, target_mps: Any = 8.0,
    red_until_s: float = 0.0, red_arc_m: float = np.inf, stage: BatchSimulation | None = None,
    **fields: Any,
) -> Drive:  # fmt: skip
    """Drive all cars from `starts` (S, 8) among the same `others`, or each among `others_of` it."""
    count, ticks = len(starts), round(seconds / TICK_S)
    others_of = [others] * count if others else others_of
    stage = _stage(vehicle.name, count) if stage is None else stage
    stage.seed(
        starts,
        steering_delay_s=np.full(count, vehicle.steering_delay_s.value),
        friction_factor=np.ones(count),
        backwards=np.full(count, getattr(planner, "drives_backwards", False)),
    )
    driver: Planner = planner.begin(count) if isinstance(planner, RemembersWithinJob) else planner
    centre_m = box_centre_from_base_m(vehicle)
    front_m = centre_m + vehicle.length_m.value / 2.0
    record = [stage.states.copy()]
    arcs, offsets = [], []
    away = []
    near: Array | None = None
    for tick in range(ticks + 1):
        time_s = tick * TICK_S
        now = stage.states.copy()
        view = view_of(
            path, now, vehicle, time_s=time_s, near_arc_m=near, target_mps=target_mps, **fields
        )
        near = view.arc_m
        arcs.append(view.arc_m)
        offsets.append(view.offset_m)
        nearest = np.full(count, np.inf)
        if others_of:
            seen, poses = see_each(path, others_of, time_s)
            gap, speed = lead_of(seen, view.arc_m, view.offset_m, vehicle)
            view = view._replace(users=seen, lead_gap_m=gap, lead_speed_mps=speed)
            size = seen.size_m
            yaw = now[:, None, 2]
            ego = now[:, None, :2] + centre_m * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
            nearest = clearance(
                Rectangles(ego, yaw, vehicle.length_m.value, vehicle.width_m.value),
                Rectangles(poses[..., :2], poses[..., 2], size[..., 0], size[..., 1]),
            ).min(axis=1)
        away.append(nearest)
        if tick == ticks:
            break
        if np.isfinite(red_arc_m):
            red = (time_s < red_until_s) & (view.arc_m + front_m < red_arc_m)
            view = view._replace(stop_arc_m=np.where(red, red_arc_m, np.inf))
        stage.step(Controls(*driver.plan(view)))
        record.append(stage.states.copy())
    arc = np.stack(arcs, axis=1)
    return Drive(
        np.stack(record, axis=1), np.stack(away, axis=1), arc, np.stack(offsets, 1), arc + front_m
    )


def straight(length_m: float = 200.0, *, from_m: float = 0.0, y_m: float = 0.0) -> FrenetPath:
    return FrenetPath(np.array([[from_m, y_m], [from_m + length_m, y_m]]))
