"""Metrics of a job's futures: from what was recorded to numbers by name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.futures import Job
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.futures.closed_loop import DriveRecord
from foretwin.sim_worker.futures.scene import JobScene, SceneMaker
from foretwin.sim_worker.metrics.evaluation import evaluate
from foretwin.sim_worker.metrics.rollout import Context, Rollout
from foretwin.sim_worker.metrics.route_rules import RouteRules
from foretwin.sim_worker.metrics.table import METRICS
from foretwin.sim_worker.road_users.cast import KIND_NAMES
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

CLEARANCE, PROGRESS = "min_clearance", "progress"


class JobMetrics(NamedTuple):
    """Metrics that the job names, each (S,), clearances (S,), infinite without others, and progress
    (S,) along the path."""

    values: dict[str, Array]
    clearance_m: Array
    progress_m: Array


def measure(
    job: Job,
    scene: JobScene,
    record: DriveRecord,
    user_size_m: Array,
    last: Indices,
    *,
    vehicle: VehicleParameters,
    every: int,
    scenes: SceneMaker,
) -> JobMetrics:
    """Measure what the job names, clearance and progress, at the instants of the result, up to
    the `last` of each future (S,).

    `scenes` are those of the job's World.

    Raises ValueError for a metric that is unknown, or that a job cannot give what it needs.
    """
    count = len(scene.starts)
    clearance = np.full(count, np.inf)
    names = list(job.metrics)
    instants = record.states[:, ::every]
    over = last < instants.shape[1] - 1
    if scene.traffic is not None:
        names = list(dict.fromkeys([CLEARANCE, *names, *([PROGRESS] if over.any() else [])]))
    if not names:
        return JobMetrics({}, clearance, record.progress_m)
    rollout = Rollout(
        time_s=np.arange(instants.shape[1], dtype=np.float64) * job.step_s,
        states=instants,
        users=record.users[:, ::every],
        user_speed_mps=record.user_speed_mps[:, ::every],
        user_size_m=user_size_m,
        valid=np.asarray(record.valid.all(axis=1)),
        vehicle=vehicle,
        last=last if over.any() else None,
    )
    needs = {need for name in names if name in METRICS for need in METRICS[name].needs}
    context = Context(
        path=scene.path,
        ground=scenes.drivable if "ground" in needs else None,
        rules=RouteRules(scene.lights.world, scene.path) if "rules" in needs else None,
        lanes=scenes.lanes if "lanes" in needs else None,
        user_mass_kg=_masses(scene) if "user_mass_kg" in needs else None,
        start_s=job.drive_time_s,
        live=scene.lights.live,
        learnt=scene.lights.learnt,
    )
    found = evaluate(rollout, names, context=context)
    if CLEARANCE in found:
        clearance = found[CLEARANCE].values
    way_m = record.progress_m
    if over.any():
        way_m = np.where(over, found[PROGRESS].values, way_m)
    return JobMetrics({name: found[name].values for name in job.metrics}, clearance, way_m)


def _masses(scene: JobScene) -> Array:
    """Return (S, R) masses of road users by their kinds."""
    if scene.traffic is None:
        return np.zeros((len(scene.starts), 0))
    masses = np.array([KINDS[kind].mass_kg for kind in KIND_NAMES])
    return masses[scene.traffic.crowd.kinds]
