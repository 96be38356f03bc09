"""Futures of the car: a job's futures simulated side by side from its live state.

`run_job` is a pure function of World, vehicle and job: its result is the same bits whichever
worker runs it, however often, whatever the stage did before. Collisions with road users are
touches of oriented rectangles, found between control ticks too; collisions with buildings and
islands are contacts of the physics.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.futures import (
    JOB_SCHEMA_VERSION,
    Accident,
    EngineName,
    FuturesResult,
    Job,
    Outcome,
    PlannedImpacts,
    RoadUserTracks,
    Trajectory,
)
from foretwin.contracts.trace import span
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.briefing import briefing_of
from foretwin.sim_worker.futures.closed_loop import NO_STACKS, DriveRecord, Stacks, drive
from foretwin.sim_worker.futures.ego_dry_run import rehearsed_cases
from foretwin.sim_worker.futures.job_accidents import accident_messages, run_on
from foretwin.sim_worker.futures.measuring import measure
from foretwin.sim_worker.futures.outcomes import (
    OVERLAP_STEPS,
    find_collisions,
    judge,
    with_collisions,
)
from foretwin.sim_worker.futures.planned_impacts import planned_impacts
from foretwin.sim_worker.futures.scene import JobScene, SceneMaker
from foretwin.sim_worker.planner_interface import Briefing
from foretwin.sim_worker.road_users.cast import KIND_NAMES
from foretwin.sim_worker.scenarios.places import Unplaced
from foretwin.sim_worker.scenarios.roles import StagedCase


def run_job(
    job: Job,
    stage: BatchSimulation,
    *,
    worker_id: str = "",
    scenes: SceneMaker | None = None,
    stacks: Stacks = NO_STACKS,
) -> FuturesResult:
    """Simulate a job on a stage that holds the job's World; `scenes` are those of that World,
    `stacks` the driving stacks that its futures may name besides foretwin's planners.

    A staged future whose case has no place there is not played, but listed in `unplaced`. Raises
    ValueError for another World, more futures than simulations, an unknown planner, scenario or
    number, a step that is no multiple of the control tick, or a state that is not finite; PlayAgain
    where a stack was lost and the whole job has to be played anew.
    """
    wall_start, cpu_start = time.perf_counter(), time.process_time()
    world = stage.world
    if world is None or world.id != job.world_id:
        held = "open ground" if world is None else world.id
        raise ValueError(f"job for world {job.world_id} on a stage that holds {held}")
    check_job(job, stage)
    ticks, every = _ticks(job, stage)
    maker = SceneMaker(world) if scenes is None else scenes
    given = job
    job, staged, unplaced = _placed(job, rehearsed_cases(job, stage.vehicle, maker))
    time_s = np.arange(0, ticks + 1, every, dtype=np.float64) * stage.control_dt_s
    if job.futures:
        brief = functools.partial(briefing_of, given, job, maker)
        played = _play(job, staged, stage, maker, stacks, brief, ticks=ticks, every=every)
    else:
        played = _nothing_played(job, len(time_s))
    return FuturesResult(
        round_id=job.round_id,
        job_index=job.job_index,
        worker_id=worker_id,
        world_id=job.world_id,
        future_indices=tuple(future.index for future in job.futures),
        trajectory=Trajectory(stamp_ns=job.state.stamp_ns, time_s=time_s, states=played.states),
        road_users=played.road_users,
        outcome=played.outcome,
        metrics=played.metrics,
        accidents=played.accidents,
        left_out=played.left_out,
        planned=played.planned,
        unplaced=unplaced,
        sim_seconds=len(job.futures) * job.horizon_s,
        cpu_seconds=time.process_time() - cpu_start,
        wall_seconds=time.perf_counter() - wall_start,
        vehicle_version=job.vehicle_version,
    )


class _Played(NamedTuple):
    """What a job's futures make of its result; `states` (S, N, 8)."""

    states: Array32
    road_users: RoadUserTracks
    outcome: Outcome
    metrics: dict[str, Array]
    accidents: tuple[Accident, ...] = ()
    left_out: tuple[str, ...] = ()
    planned: PlannedImpacts | None = None


def _play(
    job: Job,
    staged: Mapping[int, StagedCase],
    stage: BatchSimulation,
    maker: SceneMaker,
    stacks: Stacks,
    brief: Callable[[JobScene], Briefing],
    *,
    ticks: int,
    every: int,
) -> _Played:
    with span("cast"):
        scene = maker.scene(job, stage.vehicle, tick_s=stage.control_dt_s, staged=staged)
    with span("step", ticks=ticks), np.errstate(over="ignore", invalid="ignore"):
        record = drive(
            scene, stage, ticks=ticks, stacks=stacks, brief=functools.partial(brief, scene)
        )
        states = record.states[:, ::every].astype(np.float32)
    sizes = _sizes(scene)
    with span("collisions"):
        hits = find_collisions(stage.vehicle, record, sizes, tick_s=stage.control_dt_s)
    last = hits.last_instants(states.shape[1], step_s=job.step_s, after_steps=OVERLAP_STEPS)
    with span("metrics"):
        measured = measure(
            job, scene, record, sizes, last, vehicle=stage.vehicle, every=every, scenes=maker
        )
    outcome = judge(record, hits, measured)
    with span("accidents"):
        ran_on = run_on(job, scene, stage, hits) if job.accidents else None
    motion = ran_on if job.accident_motion else None
    states = with_collisions(states, hits, motion, step_s=job.step_s)
    accidents = () if ran_on is None else accident_messages(ran_on)
    planned = planned_impacts(staged, states, accidents, stage.vehicle, step_s=job.step_s)
    tracks = _tracks(scene, record, sizes, every)
    return _Played(states, tracks, outcome, measured.values, accidents, scene.left_out, planned)


def run_alone(job: Job, world: World, vehicle: VehicleParameters) -> FuturesResult:
    """Simulate a job on a stage made for it alone; raises as `run_job`."""
    stage = stage_for(job.engine, world, vehicle, nsim=len(job.futures), control_hz=job.control_hz)
    try:
        return run_job(job, stage)
    finally:
        stage.close()


def stage_for(
    engine: EngineName,
    world: World | None,
    vehicle: VehicleParameters,
    *,
    nsim: int,
    control_hz: float = 20.0,
    threads: int = 1,
) -> BatchSimulation:
    """Return a stage whose cars an engine moves; raises ValueError where it is not at hand."""
    if engine == "mujoco":
        return BatchSimulation(world, vehicle, nsim=nsim, control_hz=control_hz, threads=threads)
    from foretwin.sim_worker.engines.engine_stage import EngineStage

    return EngineStage(world, vehicle, engine=engine, nsim=nsim, control_hz=control_hz)


def check_job(job: Job, stage: BatchSimulation) -> None:
    """Raise ValueError for a job that this version, or this stage, cannot play."""
    if job.schema_version != JOB_SCHEMA_VERSION:
        raise ValueError(
            f"a job of schema version {job.schema_version}; this foretwin plays version "
            f"{JOB_SCHEMA_VERSION}"
        )
    if job.engine != stage.engine:
        raise ValueError(f"a job for the engine {job.engine} on a stage of {stage.engine}")
    if job.anchor is not None or job.model:
        raise ValueError("a job with an anchor or a learnt model; this foretwin knows neither")
    ahead = job.speed_ahead_mps
    if not isinstance(ahead, msgspec.UnsetType) and not (len(ahead) and np.isfinite(ahead).all()):
        raise ValueError(f"speed_ahead_mps needs speeds, all of them finite: {ahead.tolist()}")
    bends_mps2 = job.bend_accel_mps2
    if not isinstance(bends_mps2, msgspec.UnsetType) and not 0.0 < bends_mps2 < np.inf:
        raise ValueError(f"bend_accel_mps2 is to be above 0 and finite, not {bends_mps2}")
    if abs(job.control_hz * stage.control_dt_s - 1.0) > 1e-9:
        raise ValueError(
            f"a job of {job.control_hz:g} control ticks a second on a stage of "
            f"{1.0 / stage.control_dt_s:g}"
        )


def _placed(
    job: Job, staged: Mapping[int, StagedCase | Unplaced]
) -> tuple[Job, dict[int, StagedCase], tuple[tuple[int, str], ...]]:
    """Return the job of those futures that can be played, their cases, and why others cannot."""
    unplaced = {
        job.futures[row].index: case.reason
        for row, case in staged.items()
        if isinstance(case, Unplaced)
    }
    rows = [row for row, future in enumerate(job.futures) if future.index not in unplaced]
    cases = {
        place: case
        for place, row in enumerate(rows)
        if isinstance(case := staged.get(row), StagedCase)
    }
    if unplaced:
        starts = None if job.starts is None else job.starts[rows]
        placed = tuple(job.futures[row] for row in rows)
        job = msgspec.structs.replace(job, futures=placed, starts=starts)
    return job, cases, tuple(unplaced.items())


def _nothing_played(job: Job, instants: int) -> _Played:
    none, flags = np.zeros(0), np.zeros(0, dtype=bool)
    tracks = RoadUserTracks(
        poses=np.zeros((0, instants, 0, 3), np.float32),
        speed_mps=np.zeros((0, instants, 0), np.float32),
        size_m=np.zeros((0, 0, 2), np.float32),
        kinds=np.zeros((0, 0), np.int32),
        kind_names=KIND_NAMES,
    )
    outcome = Outcome(
        collided=flags,
        collision_time_s=none,
        collision_with=none,
        min_clearance_m=none,
        progress_m=none,
        valid=flags,
    )
    states = np.zeros((0, instants, 8), np.float32)
    return _Played(states, tracks, outcome, dict.fromkeys(job.metrics, none))


def _ticks(job: Job, stage: BatchSimulation) -> tuple[int, int]:
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


def _sizes(scene: JobScene) -> Array:
    """Return (S, R, 2) length and width of road users."""
    if scene.traffic is None:
        return np.zeros((len(scene.starts), 0, 2))
    crowd = scene.traffic.crowd
    return np.stack([crowd.length_m, crowd.width_m], axis=-1)


def _tracks(scene: JobScene, record: DriveRecord, sizes: Array, every: int) -> RoadUserTracks:
    count, _, most, _ = record.users.shape
    kinds = np.zeros((count, most)) if scene.traffic is None else scene.traffic.crowd.kinds
    absent = np.isnan(record.users[:, ::every, :, 0])
    return RoadUserTracks(
        poses=record.users[:, ::every].astype(np.float32),
        speed_mps=np.where(absent, np.nan, record.user_speed_mps[:, ::every]).astype(np.float32),
        size_m=sizes.astype(np.float32),
        kinds=kinds.astype(np.int32),
        kind_names=KIND_NAMES,
    )
