"""Futures of the car: a job's variants simulated side by side from its live state.

`run_job` is a pure function of World, vehicle and job: its result is the same bits whichever
worker runs it, however often, whatever the stage did before. Collisions with road users are
touches of oriented rectangles, found between control ticks too; collisions with buildings and
islands are contacts of the physics.
"""

from __future__ import annotations

import hashlib
import time

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import content_bytes
from foretwin.contracts.futures import (
    Accident,
    FuturesJob,
    FuturesResult,
    RoadUserTracks,
    Trajectory,
)
from foretwin.sim_worker.batch.accident import Accidents, run_accidents
from foretwin.sim_worker.batch.batch_simulation import Stage
from foretwin.sim_worker.batch.collision_detection import Touches
from foretwin.sim_worker.futures.closed_loop import DriveRecord, drive
from foretwin.sim_worker.futures.ego_dry_run import staged_cases
from foretwin.sim_worker.futures.measuring import measure
from foretwin.sim_worker.futures.outcomes import judge, with_collisions
from foretwin.sim_worker.futures.scene import Scene, SceneMaker
from foretwin.sim_worker.road_users.cast import KIND_NAMES


def run_job(
    job: FuturesJob,
    stage: Stage,
    *,
    worker_id: str = "",
    scenes: SceneMaker | None = None,
) -> FuturesResult:
    """Simulate a job on a stage that holds the job's World; `scenes` are those of that World.

    Raises ValueError for another World, more variants than simulations, an unknown planner or
    scenario, a step that is no multiple of the control tick, or a state that is not finite.
    """
    wall_start, cpu_start = time.perf_counter(), time.process_time()
    world = stage.world
    if world is None or world.id != job.world_id:
        held = "open ground" if world is None else world.id
        raise ValueError(f"job for world {job.world_id} on a stage that holds {held}")
    ticks, every = _ticks(job, stage)
    maker = SceneMaker(world) if scenes is None else scenes
    staged = staged_cases(job, stage, maker)
    scene = maker.scene(job, stage.vehicle, tick_s=stage.control_dt_s, staged=staged)
    with np.errstate(over="ignore", invalid="ignore"):
        record = drive(scene, stage, ticks=ticks)
        states = record.states[:, ::every].astype(np.float32)
    sizes = _sizes(scene)
    measured = measure(job, scene, record, sizes, vehicle=stage.vehicle, every=every, scenes=maker)
    outcome, touches = judge(
        stage.vehicle, record, sizes, measured.clearance_m, tick_s=stage.control_dt_s
    )
    accidents = _accidents(job, scene, stage, touches) if job.accidents else None
    return FuturesResult(
        round_id=job.round_id,
        job_index=job.job_index,
        worker_id=worker_id,
        world_id=job.world_id,
        variant_indices=tuple(variant.index for variant in job.variants),
        trajectory=Trajectory(
            stamp_ns=job.state.stamp_ns,
            time_s=np.arange(0, ticks + 1, every, dtype=np.float64) * stage.control_dt_s,
            states=with_collisions(states, outcome, accidents, step_s=job.step_s),
        ),
        road_users=_tracks(scene, record, sizes, every),
        outcome=outcome,
        metrics=measured.values,
        accidents=() if accidents is None else _told(accidents),
        left_out=scene.left_out,
        sim_seconds=len(job.variants) * job.horizon_s,
        cpu_seconds=time.process_time() - cpu_start,
        wall_seconds=time.perf_counter() - wall_start,
        vehicle_version=job.vehicle_version,
    )


def result_digest(result: FuturesResult) -> str:
    """Return the SHA-256 of everything in a result that does not depend on who computed it."""
    parts = (result.trajectory, result.outcome, result.road_users, *result.accidents)
    digest = hashlib.sha256(
        f"{result.round_id} {result.job_index} {result.world_id} {result.variant_indices}".encode()
    )
    for part in parts:
        digest.update(content_bytes(part))
    for name, values in sorted(result.metrics.items()):
        digest.update(name.encode() + np.ascontiguousarray(values).tobytes())
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


def _sizes(scene: Scene) -> Array:
    """Return (S, R, 2) length and width of road users."""
    if scene.casts is None:
        return np.zeros((len(scene.starts), 0, 2))
    crowd = scene.casts.crowd
    return np.stack([crowd.length_m, crowd.width_m], axis=-1)


def _tracks(scene: Scene, record: DriveRecord, sizes: Array, every: int) -> RoadUserTracks:
    count, _, most, _ = record.users.shape
    kinds = np.zeros((count, most), np.int32) if scene.casts is None else scene.casts.kinds
    absent = np.isnan(record.users[:, ::every, :, 0])
    return RoadUserTracks(
        poses=record.users[:, ::every].astype(np.float32),
        speed_mps=np.where(absent, np.nan, record.user_speed_mps[:, ::every]).astype(np.float32),
        size_m=sizes.astype(np.float32),
        kinds=kinds.astype(np.int32),
        kind_names=KIND_NAMES,
    )


def _accidents(job: FuturesJob, scene: Scene, stage: Stage, touches: Touches) -> Accidents:
    assert scene.casts is not None or not len(touches.future)
    kinds = (
        []
        if scene.casts is None
        else [KIND_NAMES[kind] for kind in scene.casts.kinds[touches.future, touches.user]]
    )
    return run_accidents(
        stage.vehicle,
        touches,
        kinds=kinds,
        friction_factor=scene.faults.friction_factor[touches.future],
        step_s=job.step_s,
    )


def _told(accidents: Accidents) -> tuple[Accident, ...]:
    return tuple(
        Accident(
            future=int(accidents.future[i]),
            road_user=int(accidents.user[i]),
            time_s=float(accidents.time_s[i]),
            point_m=accidents.point_m[i],
            angle_rad=float(accidents.angle_rad[i]),
            closing_mps=float(accidents.closing_mps[i]),
            ego_delta_v_mps=float(np.hypot(*accidents.ego_delta_v_mps[i])),
            user_delta_v_mps=float(np.hypot(*accidents.user_delta_v_mps[i])),
        )
        for i in np.flatnonzero(accidents.valid)
    )
