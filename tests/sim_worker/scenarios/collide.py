"""Plays a cast without anybody intervening, tick by tick: what is touched first, where and when.

Written apart from the placement: poses come from paths made anew of what the cast says, and the
touch is found by stepping.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.rectangles import Rectangles, clearance, overlapping
from foretwin.sim_worker import driver_model as driver
from foretwin.sim_worker.scenarios.casting import StagedActor, StagedCase

TICK_S, STEP_S = 0.002, 0.01


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
    path = FrenetPath(actor.xy_m).eased
    arc = driven_arcs(actor, path, time_s)
    pose = path.pose_at(arc, actor.lateral_m)
    return Rectangles(pose.xy_m, pose.yaw_rad, actor.traits.length_m, actor.traits.width_m)


def driven_arcs(actor: StagedActor, path: FrenetPath, time_s: Array) -> Array:
    """Return where an actor is at times, stepping its speed through bends."""
    brisk = driver.HEEDLESS_BRISKNESS
    if actor.conduct == "stops":
        brisk = min(brisk, actor.decel_mps2 / driver.COMFORT_DECEL_MPS2)
    speed, arc, braked = bend_speeds(path, actor.speed_mps, brisk), actor.start_arc_m, math.inf
    instants = np.arange(0.0, float(np.max(time_s)) + STEP_S, STEP_S)
    arcs = [arc]
    for now in instants[:-1].tolist():
        free = float(np.interp(arc, path.arc_m, speed))
        free = float(np.interp(arc + free * STEP_S / 2.0, path.arc_m, speed))
        before = min(braked, free)
        if actor.conduct == "stops" and now >= actor.acts_after_s - 1e-9:
            braked = max(before - actor.decel_mps2 * STEP_S, 0.0)
        after = min(braked, free)
        arc += (before + after) / 2.0 * STEP_S if actor.speed_mps > 0.0 else 0.0
        arcs.append(arc)
    return np.interp(time_s, instants, arcs)


def bend_speeds(path: FrenetPath, speed_mps: float, brisk: float) -> Array:
    """Return the speeds at a path's nodes that a heedless driver has who wants `speed_mps`."""
    yaw = path.node_poses[:, 2].tolist()
    found = [speed_mps] * len(yaw)
    for i in range(len(yaw) - 1):
        turn = max(abs(yaw[i + 1] - yaw[i]), 1e-9)
        most = math.sqrt(brisk * driver.LATERAL_ACCEL_MPS2 / turn)
        found[i], found[i + 1] = min(found[i], most), min(found[i + 1], most)
    for i in range(1, len(found)):
        reached = math.sqrt(found[i - 1] ** 2 + 2.0 * brisk * driver.MAX_ACCEL_MPS2)
        found[i] = min(found[i], reached)
    for i in reversed(range(len(found) - 1)):
        needed = math.sqrt(found[i + 1] ** 2 + 2.0 * brisk * driver.COMFORT_DECEL_MPS2)
        found[i] = min(found[i], needed)
    return np.array(found)
