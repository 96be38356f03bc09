"""Collisions of a job's futures with road users, run on as two bodies in motion."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.futures import Accident, Job
from foretwin.sim_worker.batch.accident import (
    ACCIDENT_S,
    DELTA_V_WITHIN_S,
    Accidents,
    run_accidents,
)
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.batch.collision_detection import Touches
from foretwin.sim_worker.futures.outcomes import Collisions
from foretwin.sim_worker.futures.scene import JobScene
from foretwin.sim_worker.road_users.cast import KIND_NAMES


def run_on(job: Job, scene: JobScene, stage: BatchSimulation, hits: Collisions) -> Accidents:
    """Return the accidents that collisions of a job's futures come to."""
    touches = Touches._make(field[hits.counts] for field in hits.touches)
    kinds = []
    if scene.traffic is not None:
        met = scene.traffic.crowd.kinds[touches.future, touches.user]
        kinds = [KIND_NAMES[kind] for kind in met]
    # Without the motion after it, an accident is over once its delta-v is.
    enough_s = math.ceil(DELTA_V_WITHIN_S / job.step_s - 1e-9) * job.step_s
    return run_accidents(
        stage.vehicle,
        touches,
        kinds=kinds,
        friction_factor=scene.numbers.applied("ground.friction_factor", 1.0)[touches.future],
        duration_s=ACCIDENT_S if job.accident_motion else enough_s,
        step_s=job.step_s,
    )


def accident_messages(accidents: Accidents) -> tuple[Accident, ...]:
    """Return accidents as they stand in a result."""
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
