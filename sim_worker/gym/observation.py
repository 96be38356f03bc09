"""What a learner sees: a vector of fixed size, every entry scaled to between -1 and 1.

`feature_names` lists the entries; docs/learning.md explains them.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.sim_worker.driver_model import COMFORT_DECEL_MPS2, LATERAL_ACCEL_MPS2
from foretwin.sim_worker.gym.rows import Sighting
from foretwin.sim_worker.planner_interface import PlannerView
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m, front_from_base_m

Observation = npt.NDArray[np.float32]

SPEED_MPS, ACCEL_MPS2, YAW_RATE_RADPS, SLIDE_MPS = 20.0, 8.0, 1.0, 5.0
OFFSET_M, CURVATURE_PM, FAR_M = 4.0, 0.2, 60.0
LENGTH_M, WIDTH_M = 12.0, 3.0
"""What a 1 stands for; where nothing is ahead, distances are a 1."""
CURVATURE_AT_M = (0.0, 5.0, 10.0, 20.0, 30.0, 45.0)
GROUND_PIECES = 2

_EGO = ("speed", "slide", "yaw_rate", "tire_angle", "accel", "offset", "heading")
_WAY = ("target_speed", "bend_speed", "to_end", "lead_gap", "lead_speed", "stop_line", "wait_line")
_MOTION = ("ahead", "left", "ahead_speed", "left_speed", "heading_cos", "heading_sin")
_USER = ("present", *_MOTION, "length", "width")
_GROUND = ("enter", "leave", "waits")


def feature_names(nearest: int) -> tuple[str, ...]:
    """Return the name of every entry of an observation with so many road users."""
    curves = [f"curvature_{at:g}m" for at in CURVATURE_AT_M]
    ground = [f"ground{k}_{part}" for k in range(GROUND_PIECES) for part in _GROUND]
    users = [f"user{k}_{part}" for k in range(nearest) for part in _USER]
    return (*_EGO, *curves, *_WAY, *ground, *users)


def observe(seen: Sighting, *, nearest: int) -> Observation:
    """Return observations (S, D), newly made, of what S cars see."""
    view = seen.view
    parts = [_ego(view), _curves(view), _way(seen), _ground(view), _users(view, nearest)]
    found = np.concatenate(parts, axis=1)
    np.clip(found, -1.0, 1.0, out=found)
    return found.astype(np.float32)


def _ego(view: PlannerView) -> Array:
    states = view.states
    heading = wrap_angle(states[:, 2] - view.path.yaw_at(view.arc_m))
    return np.column_stack(
        [
            states[:, 3] / SPEED_MPS,
            states[:, 4] / SLIDE_MPS,
            states[:, 5] / YAW_RATE_RADPS,
            states[:, 6] / view.vehicle.max_tire_angle_rad.value,
            states[:, 7] / ACCEL_MPS2,
            (view.offset_m - view.desired_offset_m) / OFFSET_M,
            heading / math.pi,
        ]
    )


def _curves(view: PlannerView) -> Array:
    at = view.arc_m[:, None] + np.array(CURVATURE_AT_M)
    return view.path.at_nodes(view.path.curvature_pm, at) / CURVATURE_PM


def _way(seen: Sighting) -> Array:
    view = seen.view
    profile = view.path.speed_profile(
        lateral_accel_mps2=LATERAL_ACCEL_MPS2, decel_mps2=COMFORT_DECEL_MPS2
    )
    front = view.arc_m + front_from_base_m(view.vehicle)
    stop = np.full(len(front), np.inf) if view.stop_arc_m is None else view.stop_arc_m - front
    return np.column_stack(
        [
            view.target_speed_mps / SPEED_MPS,
            view.path.at_nodes(profile, view.arc_m) / SPEED_MPS,
            seen.to_end_m / FAR_M,
            view.lead_gap_m / FAR_M,
            view.lead_speed_mps / SPEED_MPS,
            stop / FAR_M,
            (seen.wait_arc_m - front) / FAR_M,
        ]
    )


def _ground(view: PlannerView) -> Array:
    """Return the next pieces of ground that others cross or join: where, and whether to wait."""
    count = len(view.arc_m)
    found = np.tile([1.0, 1.0, 0.0], (count, GROUND_PIECES, 1))
    ground = view.ground
    if ground is None or not len(ground.enter_arc_m):
        return found.reshape(count, -1)
    front = view.arc_m + front_from_base_m(view.vehicle)
    rear = front - view.vehicle.length_m.value
    ahead = ground.leave_arc_m > rear[:, None]
    order = np.argsort(~ahead, axis=1, kind="stable")[:, :GROUND_PIECES]
    rows = np.arange(count)[:, None]
    there = ahead[rows, order]
    shown = found[:, : order.shape[1]]
    shown[..., 0] = np.where(there, (ground.enter_arc_m[order] - front[:, None]) / FAR_M, 1.0)
    shown[..., 1] = np.where(there, (ground.leave_arc_m[order] - front[:, None]) / FAR_M, 1.0)
    shown[..., 2] = there & ground.waits[order]
    return found.reshape(count, -1)


def _users(view: PlannerView, nearest: int) -> Array:
    """Return the nearest road users, as seen from the middle of the car and its heading."""
    states, users = view.states, view.users
    count = len(states)
    found = np.zeros((count, nearest, len(_USER)))
    if users is None or not nearest or not users.poses.shape[1]:
        return found.reshape(count, -1)
    cos, sin = np.cos(states[:, 2:3]), np.sin(states[:, 2:3])
    middle = box_centre_from_base_m(view.vehicle)
    dx = users.poses[..., 0] - states[:, :1] - middle * cos
    dy = users.poses[..., 1] - states[:, 1:2] - middle * sin
    distance = np.square(dx) + np.square(dy)
    distance = np.where(np.isfinite(distance), distance, np.inf)
    order = np.argsort(distance, axis=1, kind="stable")[:, :nearest]
    rows = np.arange(count)[:, None]
    here = np.isfinite(distance[rows, order])
    dx, dy = dx[rows, order], dy[rows, order]
    turned = users.poses[rows, order, 2] - states[:, 2:3]
    speed = users.speed_mps[rows, order]
    turned_cos, turned_sin = np.cos(turned), np.sin(turned)
    columns = (
        np.ones_like(dx),
        (cos * dx + sin * dy) / FAR_M,
        (cos * dy - sin * dx) / FAR_M,
        (speed * turned_cos - states[:, 3:4]) / SPEED_MPS,
        (speed * turned_sin - states[:, 4:5]) / SPEED_MPS,
        turned_cos,
        turned_sin,
        users.size_m[rows, order, 0] / LENGTH_M,
        users.size_m[rows, order, 1] / WIDTH_M,
    )
    shown = found[:, : order.shape[1]]
    shown[:] = np.where(here[..., None], np.stack(columns, axis=-1), 0.0)
    return found.reshape(count, -1)
