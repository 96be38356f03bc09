"""The ego of a case that drives alone: how it keeps its speed along its path, as a car does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.futures import Future, Job
from foretwin.contracts.numbers import FUTURE_NUMBERS
from foretwin.contracts.scenario import EGO, FAULTS
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.closed_loop import drive
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.scenarios.staged import staged_start

_FORWARDS, _BACKWARDS = "constant_speed", "reverse_pursuit"
_FELT = tuple(
    name
    for name, row in FUTURE_NUMBERS.items()
    if row.part == "fault" and not row.acts_on.startswith("perception.")
)


def felt_faults(values: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Return what is wrong with a car or the ground that one who drives alone feels, by name."""
    return tuple(
        (name, values.get(f"{FAULTS}.{name}", FUTURE_NUMBERS[name].neutral)) for name in _FELT
    )


def drive_alone(
    job: Job, cases: Sequence[StagedCase], stage: BatchSimulation, maker: SceneMaker, ticks: int
) -> Array:
    """Return states (S, T, 8) of egos that begin as their cases do, without other road users."""
    futures = tuple(
        Future(
            index=index,
            name="alone",
            planner=_BACKWARDS if case.place.reverse else _FORWARDS,
            numbers=dict(felt_faults(case.values)),
            values={f"{EGO}.speed_mps": case.ego_speed_mps},
        )
        for index, case in enumerate(cases)
    )
    same = ("round_id", "job_index", "world_id", "state", "path", "step_s", "seed")
    given: dict[str, Any] = {name: getattr(job, name) for name in same}
    alone = Job(
        **given,
        futures=futures,
        horizon_s=ticks * stage.control_dt_s,
        cruise_speed_mps=0.0,
        starts=np.stack([staged_start(case, stage.vehicle) for case in cases]),
    )
    near = np.array([case.ego_arc_m for case in cases])
    scene = maker.scene(alone, stage.vehicle, tick_s=stage.control_dt_s, start_arc_m=near)
    return drive(scene._replace(limit_share=None), stage, ticks=ticks).states
