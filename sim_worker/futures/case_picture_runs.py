"""A case driven twice for its picture: by an ego that keeps its speed, and by a planner."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import RESULT_STEP_S, FuturesResult
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath, PathPose
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.batch.collision_detection import ego_rectangles
from foretwin.sim_worker.futures.playable import job_at
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.scenarios.roles import StagedCase


class Run(NamedTuple):
    """One drive of a case at instants `time_s` (N,): the ego's boxes, and those of R others.

    `others` holds poses (N, R, 3) of box centres, NaN where there is none. `moment` is the instant
    of the first touch, else that of the least clearance, `clearance_m` away.
    """

    time_s: Array
    ego: Rectangles
    others: tuple[Rectangles, ...]
    moment: int
    clearance_m: float
    collision_s: float
    """When the ego collides, not a number where it does not."""
    collision_with: str


def heedless_run(
    played: StagedCase,
    vehicle: VehicleParameters,
    alone: Callable[[Array], PathPose],
    *,
    horizon_s: float,
) -> Run:
    """Drive a case as planned: the ego keeps its speed, and so do all heedless road users.

    `alone` says where that ego drives at times (N,). It ends with the planned impact, where one is
    planned.
    """
    end_s = played.impact_time_s if played.impact_with else horizon_s
    time = np.linspace(0.0, end_s, max(2, math.ceil(end_s / RESULT_STEP_S) + 1))
    others = []
    for actor in played.actors:
        moving = actor.moving(FrenetPath(actor.xy_m))
        others.append(moving.rectangles(moving.arc_after(actor.start_arc_m, time)))
    xy, yaw = alone(time)
    boxes = ego_rectangles(vehicle, np.column_stack([xy, yaw]))
    return _run(time, boxes, tuple(others), played.impact_time_s, played.impact_with)


def planned_run(
    played: StagedCase,
    scenario: Scenario,
    world: World,
    vehicle: VehicleParameters,
    *,
    planner: str,
) -> Run:
    """Drive a case as a planner does, with all that a future of a job has.

    Raises ValueError where the planner fails.
    """
    stage = BatchSimulation(world, vehicle, nsim=1)
    result = run_job(job_at(played.place, scenario, [played.values], world, planner=planner), stage)
    if result.left_out[0] or not result.outcome.valid[0]:
        reason = result.left_out[0] or ", ".join(result.outcome.failures)
        raise ValueError(f"{scenario.id} at {played.place.name}: {reason}")
    return _result_run(result, played, vehicle)


def _result_run(result: FuturesResult, played: StagedCase, vehicle: VehicleParameters) -> Run:
    states = result.trajectory.states[0].astype(np.float64)
    time = result.trajectory.time_s
    outcome, users = result.outcome, result.road_users
    end, hit_s, hit = len(time), float(outcome.collision_time_s[0]), ""
    if outcome.collided[0]:
        hit = ("", "a road user", "a building or an island")[int(outcome.collision_with[0])]
        # What follows is the accident's business.
        end = max(2, math.ceil(hit_s / RESULT_STEP_S - 1e-6) + 1)
    ego = ego_rectangles(vehicle, states[:end])
    poses, sizes = users.poses[0, :end].astype(np.float64), users.size_m[0].tolist()
    others = tuple(
        Rectangles(poses[:, r, :2], poses[:, r, 2], *sizes[r]) for r in range(len(played.actors))
    )
    return _run(time[:end], ego, others, hit_s, hit)


def _run(
    time_s: Array, ego: Rectangles, others: tuple[Rectangles, ...], hit_s: float, hit: str
) -> Run:
    gaps = [clearance(ego, box) for box in others]
    gap = np.min(gaps, axis=0) if gaps else np.full(len(time_s), np.inf)
    moment = len(time_s) - 1 if hit or not gaps else int(gap.argmin())
    return Run(time_s, ego, others, moment, float(gap.min()), hit_s if hit else math.nan, hit)


def box_at(track: Rectangles, instant: int) -> Rectangles:
    """Return the box of a track at an instant; its arrays keep an axis of one."""
    at = slice(instant, instant + 1)
    return track._replace(centre_m=track.centre_m[at], yaw_rad=track.yaw_rad[at])
