"""Rollouts drawn by hand: an ego and others that keep their velocity, or follow given poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.metrics.rollout import Rollout
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m

STEP_S = 0.1
VEHICLE = load_vehicle()
LENGTH_M, WIDTH_M = VEHICLE.length_m.value, VEHICLE.width_m.value


class Mover(NamedTuple):
    """The middle of a box at time 0, its yaw, its speed along it, its length and width."""

    x: float
    y: float
    yaw: float = 0.0
    speed: float = 0.0
    length: float = 4.0
    width: float = 2.0


def times(until_s: float = 8.0, step_s: float = STEP_S) -> Array:
    return np.arange(round(until_s / step_s) + 1) * step_s


def steady_poses(mover: Mover, time_s: Array) -> Array:
    """(N, 3) poses of a box's middle that keeps its velocity."""
    way = mover.speed * time_s
    return np.column_stack(
        [mover.x + way * np.cos(mover.yaw), mover.y + way * np.sin(mover.yaw), 0 * way + mover.yaw]
    )


def states_of_centre(poses: Array, time_s: Array, vehicle: VehicleParameters = VEHICLE) -> Array:
    """(N, 8) states of base_link for poses (N, 3) of the box's middle, speeds by difference."""
    back = box_centre_from_base_m(vehicle)
    states = np.zeros((len(poses), 8))
    states[:, 0] = poses[:, 0] - back * np.cos(poses[:, 2])
    states[:, 1] = poses[:, 1] - back * np.sin(poses[:, 2])
    states[:, 2] = poses[:, 2]
    vx, vy = np.gradient(states[:, 0], time_s), np.gradient(states[:, 1], time_s)
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    states[:, 3], states[:, 4] = cos * vx + sin * vy, cos * vy - sin * vx
    states[:, 5] = np.gradient(np.unwrap(poses[:, 2]), time_s)
    return states


def rollout(
    ego: Mover | Array, *others: Mover, time_s: Array | None = None, futures: int = 1
) -> Rollout:
    """All futures alike: the ego (a Mover, or poses (N, 3) of its middle) among steady others."""
    time = times() if time_s is None else time_s
    poses = steady_poses(ego, time) if isinstance(ego, Mover) else ego
    users = np.zeros((len(time), len(others), 3))
    for k, other in enumerate(others):
        users[:, k] = steady_poses(other, time)
    speeds = np.tile([float(other.speed) for other in others], (len(time), 1))
    speeds = speeds.reshape(len(time), -1)
    sizes = np.array([[other.length, other.width] for other in others]).reshape(-1, 2)
    return Rollout(
        time_s=time,
        states=np.repeat(states_of_centre(poses, time)[None], futures, axis=0),
        users=np.repeat(users[None], futures, axis=0),
        user_speed_mps=np.repeat(speeds[None], futures, axis=0),
        user_size_m=np.repeat(sizes[None], futures, axis=0),
        valid=np.ones(futures, dtype=bool),
        vehicle=VEHICLE,
    )
