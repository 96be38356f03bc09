"""Futures of the car: a job's variants simulated side by side from its live state.

`run_job` is a pure function of World, vehicle and job: its result is the same bits whichever
worker runs it, however often, whatever the stage did before. Collisions with road users are
overlaps of oriented rectangles at each control tick (planar bodies that lie deep inside each
other touch no more), or a contact of the physics between two ticks, which can push the car back
out before the next; collisions with buildings and islands are contacts of the physics alone.
"""

from __future__ import annotations

import hashlib
import logging
import time
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from contracts.arrays import Array
from contracts.codec import content_bytes
from contracts.simulation import FuturesJob, FuturesResult, Trajectory
from sim_worker.actors.conflicts import CrossingPaths
from sim_worker.actors.motion import ActorMotion, actor_motion
from sim_worker.actors.perception import Lead, Sight, see_road_users
from sim_worker.judging import DriveRecord, held_from_collision, judge
from sim_worker.planners.base import Planner, PlannerOutput, PlannerView
from sim_worker.planners.path import FrenetPath
from sim_worker.planners.registry import load_planner
from sim_worker.seeding import local_state
from sim_worker.stage import Controls, Stage
from sim_worker.stage_model import ROAD_USER_LENGTH_M
from sim_worker.vehicle.planar import box_centre_from_base_m

_log = logging.getLogger(__name__)

_MAX_OFFSET_M = 8.0
_CAR_WITHIN_M = 60.0
"""The car is looked for on this much of the path's beginning."""

_WITHOUT_PATH: set[str] = set()
"""Ids of Worlds of which the log has said so: once per World and process is enough."""

Rows = npt.NDArray[np.intp]


class _Aims(NamedTuple):
    """What each of S futures aims at; all (S,)."""

    target_speed_mps: Array
    speed_factor: Array
    offset_m: Array


def run_job(
    job: FuturesJob,
    stage: Stage,
    *,
    worker_id: str = "",
    crossing_paths: CrossingPaths | None = None,
) -> FuturesResult:
    """Simulate a job on a stage that holds the job's World.

    Raises ValueError for another World, more variants than simulations, an unknown planner, a
    step that is no multiple of the control tick, or a state that is not finite.
    """
    wall_start, cpu_start = time.perf_counter(), time.process_time()
    world = stage.world
    if world is None or world.id != job.world_id:
        held = "open ground" if world is None else world.id
        raise ValueError(f"job for world {job.world_id} on a stage that holds {held}")
    ticks, every = _ticks(job, stage)
    path = FrenetPath(job.path.xy_m, job.path.speed_limit_mps)
    start = local_state(job.state, world.frame, stage.vehicle)
    place = path.locate(start[None, :2], upto_arc_m=_CAR_WITHIN_M)
    aims = _aims(job, float(place.offset_m[0]))
    physics_times: Array = np.arange(ticks * stage.steps_per_tick + 1, dtype=np.float64)
    physics_times = physics_times * stage.timestep_s
    motion = actor_motion(
        [variant.actor for variant in job.variants],
        crossing_paths=CrossingPaths(world) if crossing_paths is None else crossing_paths,
        ego_path=path,
        ego_arc_m=float(place.arc_m[0]),
        ego_speed_mps=float(start[3]),
        lead_offset_m=aims.offset_m,
        centre_ahead_m=box_centre_from_base_m(stage.vehicle),
        half_lengths_m=(stage.vehicle.length_m.value + ROAD_USER_LENGTH_M) / 2.0,
        time_s=physics_times,
    )
    if motion.invented and world.id not in _WITHOUT_PATH:
        _WITHOUT_PATH.add(world.id)
        _log.info("world %s offers no path that meets the ego's: a straight one is used", world.id)
    with np.errstate(over="ignore", invalid="ignore"):
        drive = _drive(job, stage, path, start, float(place.arc_m[0]), aims, motion, ticks)
        states = drive.states[:, ::every].astype(np.float32)
    poses = motion.poses[:, :: stage.steps_per_tick]
    outcome = judge(stage.vehicle, drive, poses, tick_s=stage.control_dt_s)
    return FuturesResult(
        round_id=job.round_id,
        job_index=job.job_index,
        worker_id=worker_id,
        world_id=job.world_id,
        variant_indices=tuple(variant.index for variant in job.variants),
        trajectory=Trajectory(
            stamp_ns=job.state.stamp_ns,
            time_s=np.arange(0, ticks + 1, every, dtype=np.float64) * stage.control_dt_s,
            states=held_from_collision(states, outcome, step_s=job.step_s),
        ),
        actors=poses[:, ::every].astype(np.float32),
        outcome=outcome,
        sim_seconds=len(job.variants) * job.horizon_s,
        cpu_seconds=time.process_time() - cpu_start,
        wall_seconds=time.perf_counter() - wall_start,
    )


def result_digest(result: FuturesResult) -> str:
    """Return the SHA-256 of everything in a result that does not depend on who computed it."""
    parts = (result.trajectory, result.outcome)
    digest = hashlib.sha256(
        f"{result.round_id} {result.job_index} {result.world_id} {result.variant_indices}".encode()
    )
    for part in parts:
        digest.update(content_bytes(part))
    digest.update(np.ascontiguousarray(result.actors).tobytes())
    return digest.hexdigest()


def _ticks(job: FuturesJob, stage: Stage) -> tuple[int, int]:
    """Return the number of control ticks and of ticks between two instants of the result."""
    every = job.step_s / stage.control_dt_s
    if every < 1.0 - 1e-9 or abs(every - round(every)) > 1e-6:
        raise ValueError(
            f"step_s {job.step_s:g} must be a multiple of the control tick {stage.control_dt_s:g} s"
        )
    instants = job.horizon_s / job.step_s
    if instants < 1.0 - 1e-9 or abs(instants - round(instants)) > 1e-6:
        raise ValueError(f"horizon_s {job.horizon_s:g} must be a multiple of step_s {job.step_s:g}")
    return round(instants) * round(every), round(every)


def _aims(job: FuturesJob, present_offset_m: float) -> _Aims:
    variants = job.variants
    cruise = job.cruise_speed_mps
    target = np.array(
        [cruise * v.target_speed_factor + v.target_speed_offset_mps for v in variants]
    )
    factor = np.array([v.target_speed_factor for v in variants])
    if cruise > 1.0:
        factor = target / cruise
    # The future keeps the car's present offset, or one would measure the map's error.
    present = min(max(present_offset_m, -_MAX_OFFSET_M), _MAX_OFFSET_M)
    offset = present + np.array([v.lateral_shift_m for v in variants])
    return _Aims(np.maximum(target, 0.0), factor, offset)


def _drive(
    job: FuturesJob,
    stage: Stage,
    path: FrenetPath,
    start: Array,
    start_arc_m: float,
    aims: _Aims,
    motion: ActorMotion,
    ticks: int,
) -> DriveRecord:
    count = len(job.variants)
    delay = stage.vehicle.steering_delay_s.value
    stage.seed(
        np.repeat(start[None], count, axis=0),
        steering_delay_s=np.array([delay + v.extra_steering_delay_s for v in job.variants]),
        friction_factor=np.array([v.friction_factor for v in job.variants]),
    )
    groups = _planner_groups(job)
    tick_poses = motion.poses[:, :: stage.steps_per_tick]
    users = sight = None
    if np.isfinite(tick_poses[:, 0, 0]).any():
        users = stage.road_user_motion(motion.poses[:, 1:])
        sight = Sight(see_road_users(path, tick_poses, motion.speed_mps), stage.vehicle)
    limit_share = _limit_share(path, start_arc_m)

    states = np.empty((count, ticks + 1, 8))
    contact = np.zeros((count, ticks + 1), dtype=bool)
    user_contact = contact.copy()
    valid = np.ones((count, ticks + 1), dtype=bool)
    sound = True
    arc, target = np.full(count, start_arc_m), aims.target_speed_mps
    lead = Lead(np.full(count, np.inf), np.zeros(count))
    states[:, 0] = stage.states
    for tick in range(ticks):
        now = stage.states
        if not sound:
            # What has diverged is not shown to planners: one bad future must not spoil the job.
            now = np.where(valid[:, tick, None], now, start)
        place = path.locate(now[:, :2], near_arc_m=arc)
        arc = place.arc_m
        if sight is not None:
            lead = sight.at(tick, place)
        if limit_share is not None:
            target = aims.target_speed_mps * path.at_nodes(limit_share, arc)
        view = PlannerView(
            time_s=tick * stage.control_dt_s,
            states=now,
            path=path,
            arc_m=arc,
            offset_m=place.offset_m,
            desired_offset_m=aims.offset_m,
            target_speed_mps=target,
            speed_factor=aims.speed_factor,
            lead_gap_m=lead.gap_m,
            lead_speed_mps=lead.speed_mps,
            vehicle=stage.vehicle,
        )
        accel, angle = _plan(groups, view)
        fine = np.isfinite(accel + angle)
        if not fine.all():
            accel, angle = np.where(fine, accel, 0.0), np.where(fine, angle, 0.0)
        stage.step(
            Controls(accel, angle),
            road_users=None if users is None else users.at(tick),
        )
        states[:, tick + 1] = stage.states
        if stage.looked:
            contact[:, tick + 1] = stage.static_contact
            user_contact[:, tick + 1] = stage.road_user_contact
        diverged = stage.diverged()
        if not sound or diverged.any() or not fine.all():
            valid[:, tick + 1] = valid[:, tick] & fine & ~diverged
            sound = bool(valid[:, tick + 1].all())
    ends = np.where(valid[:, -1:], stage.states[:, :2], start[:2])
    end = path.locate(ends, near_arc_m=arc).arc_m
    return DriveRecord(states, contact, user_contact, valid, end - start_arc_m)


def _planner_groups(job: FuturesJob) -> list[tuple[str, Planner, Rows | None]]:
    """Return each planner with the rows it drives; None is all of them."""
    names = [variant.planner for variant in job.variants]
    kinds = sorted(set(names))
    if len(kinds) == 1:
        return [(kinds[0], load_planner(kinds[0]), None)]
    return [
        (kind, load_planner(kind), np.array([i for i, name in enumerate(names) if name == kind]))
        for kind in kinds
    ]


def _plan(groups: list[tuple[str, Planner, Rows | None]], view: PlannerView) -> PlannerOutput:
    count = len(view.arc_m)
    accel, angle = np.empty(count), np.empty(count)
    for name, planner, rows in groups:
        mine = view if rows is None else _rows_of(view, rows)
        answer = planner.plan(mine)
        wanted = (len(mine.arc_m),)
        for field, values in zip(answer._fields, answer, strict=True):
            if np.shape(values) != wanted:
                raise ValueError(
                    f"planner {name!r} answers {field} of shape {np.shape(values)}, not {wanted}"
                )
        if rows is None:
            return answer
        accel[rows], angle[rows] = answer
    return PlannerOutput(accel, angle)


def _rows_of(view: PlannerView, rows: Rows) -> PlannerView:
    return view._replace(
        states=view.states[rows],
        arc_m=view.arc_m[rows],
        offset_m=view.offset_m[rows],
        desired_offset_m=view.desired_offset_m[rows],
        target_speed_mps=view.target_speed_mps[rows],
        speed_factor=view.speed_factor[rows],
        lead_gap_m=view.lead_gap_m[rows],
        lead_speed_mps=view.lead_speed_mps[rows],
    )


def _limit_share(path: FrenetPath, start_arc_m: float) -> Array | None:
    """Return (M,) how far the limits lie below the one where the car is, at most 1; None for 1.

    A driver's speed relates to the limit, which the map may have guessed: only its drops count.
    """
    limits = path.speed_limit_mps
    here = limits[int(np.clip(np.searchsorted(path.arc_m, start_arc_m), 0, len(limits) - 1))]
    if not np.isfinite(here):
        return None
    share = np.minimum(np.where(np.isfinite(limits), limits, here) / here, 1.0)
    return np.asarray(share) if share.min() < 1.0 else None
