"""Where the other road users of a job are at every physics step, known before it runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contracts.arrays import Array
from contracts.simulation import ActorSpec
from sim_worker.actors.conflicts import Conflict, CrossingPaths
from sim_worker.planners.path import FrenetPath

_MIN_EGO_SPEED_MPS = 2.0


class ActorMotion(NamedTuple):
    """Poses (S, T, 3) x, y, yaw of box centres, NaN where none, and speeds (S,)."""

    poses: Array
    speed_mps: Array
    invented: bool
    """Whether a path had to be invented because the World offers none."""


def actor_motion(
    actors: Sequence[ActorSpec | None],
    *,
    crossing_paths: CrossingPaths,
    ego_path: FrenetPath,
    ego_arc_m: float,
    ego_speed_mps: float,
    lead_offset_m: Array,
    centre_ahead_m: float,
    half_lengths_m: float,
    time_s: Array,
) -> ActorMotion:
    """Move each future's road user at constant speed along its path.

    `time_s` (T,) from seeding; `lead_offset_m` (S,) keeps a lead in front of a car that is off
    its lane centre; `centre_ahead_m` from base_link to the ego's box centre; `half_lengths_m` of
    both boxes together turn bumper gaps into distances of centres.
    """
    count = len(actors)
    poses = np.full((count, len(time_s), 3), np.nan)
    speeds = np.array([0.0 if actor is None else actor.speed_mps for actor in actors])
    leads = [i for i, actor in enumerate(actors) if actor is not None and actor.kind == "lead"]
    if leads:
        gaps = np.array([actor.gap_m for actor in actors if actor and actor.kind == "lead"])
        start = ego_arc_m + centre_ahead_m + half_lengths_m + gaps
        arcs = start[:, None] + speeds[leads, None] * time_s
        pose = ego_path.pose_at(arcs, lead_offset_m[leads, None])
        poses[leads, :, :2], poses[leads, :, 2] = pose.xy_m, pose.yaw_rad
    others = [i for i, actor in enumerate(actors) if actor is not None and actor.kind != "lead"]
    if not others:
        return ActorMotion(poses, speeds, False)
    conflicts = crossing_paths.conflicts(ego_path, from_arc_m=ego_arc_m)
    invented = False
    for i in others:
        actor = actors[i]
        assert actor is not None
        choices = conflicts[actor.kind]
        conflict = choices[actor.path_rank % len(choices)]
        invented |= conflict.invented
        pose = conflict.path.pose_at(
            _arcs(actor, conflict, ego_arc_m + centre_ahead_m, ego_speed_mps, time_s)
        )
        poses[i, :, :2], poses[i, :, 2] = pose.xy_m, pose.yaw_rad
    return ActorMotion(poses, speeds, invented)


def _arcs(
    actor: ActorSpec, conflict: Conflict, ego_centre_arc_m: float, ego_speed: float, time_s: Array
) -> Array:
    """Return arc lengths (T,) of an actor that meets the ego's path at its appointed time."""
    ego_there_s = (conflict.ego_arc_m - ego_centre_arc_m) / max(ego_speed, _MIN_EGO_SPEED_MPS)
    return conflict.actor_arc_m + actor.speed_mps * (time_s - ego_there_s - actor.time_offset_s)
