"""Plays a cast without anybody intervening, tick by tick: what is touched first, where and when.

Written apart from the placement: poses come from paths made anew of what the cast says, and the
touch is found by stepping.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.rectangles import Rectangles, clearance, overlapping
from foretwin.sim_worker.scenarios.casting import StagedActor, StagedCase

TICK_S = 0.002


class Collision(NamedTuple):
    """The first touch: with whom, when, and how far the ego's planned front point is from it."""

    name: str
    time_s: float
    point_m: Array
    off_actor_m: float


def first_collision(
    played: StagedCase, vehicle: VehicleParameters, *, until_s: float
) -> Collision | None:
    """Return what an ego that keeps its speed along its path touches first."""
    time = np.arange(0.0, until_s, TICK_S)
    ego = ego_boxes(played, vehicle, time)
    found: list[tuple[float, int, StagedActor]] = []
    for actor in played.actors:
        hit = np.flatnonzero(overlapping(ego, actor_boxes(actor, time)))
        if len(hit):
            found.append((float(time[hit[0]]), int(hit[0]), actor))
    if not found:
        return None
    when, tick, actor = min(found, key=lambda item: item[0])
    point = front_point(played, vehicle, time[tick : tick + 1])
    dot = Rectangles(point, np.zeros(1), 1e-6, 1e-6)
    other = actor_boxes(actor, time[tick : tick + 1])
    return Collision(actor.name, when, point[0], float(clearance(dot, other)[0]))


def ego_boxes(played: StagedCase, vehicle: VehicleParameters, time_s: Array) -> Rectangles:
    xy, yaw = ego_pose(played, time_s)
    length, rear = vehicle.length_m.value, vehicle.rear_overhang_m.value
    ahead = (length / 2.0 - rear) * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    return Rectangles(xy + ahead, yaw, length, vehicle.width_m.value)


def ego_pose(played: StagedCase, time_s: Array) -> tuple[Array, Array]:
    """Return base_link's places and where the car's nose points; in reverse, backwards."""
    path = FrenetPath(played.place.ego.xy_m)
    arc = played.ego_arc_m + played.ego_speed_mps * time_s
    pose = path.pose_at(arc, played.ego_lateral_m)
    return pose.xy_m, pose.yaw_rad + (np.pi if played.place.reverse else 0.0)


def front_point(played: StagedCase, vehicle: VehicleParameters, time_s: Array) -> Array:
    """Return the point of the leading end that the cast says is hit."""
    xy, yaw = ego_pose(played, time_s)
    length, rear = vehicle.length_m.value, vehicle.rear_overhang_m.value
    to_left = (played.impact_share - 0.5) * vehicle.width_m.value * played.place.near_sign
    ahead = length - rear
    if played.place.reverse:
        ahead, to_left = -rear, -to_left
    forward = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
    left = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)
    return xy + ahead * forward + to_left * left


def actor_boxes(actor: StagedActor, time_s: Array) -> Rectangles:
    travelled = actor.speed_mps * time_s
    if actor.conduct == "stops":
        braking = np.clip(time_s - actor.acts_after_s, 0.0, actor.speed_mps / actor.decel_mps2)
        travelled = (
            actor.speed_mps * (np.minimum(time_s, actor.acts_after_s) + braking)
            - actor.decel_mps2 * braking**2 / 2.0
        )
    pose = FrenetPath(actor.xy_m).pose_at(actor.start_arc_m + travelled, actor.lateral_m)
    return Rectangles(pose.xy_m, pose.yaw_rad, actor.traits.length_m, actor.traits.width_m)
