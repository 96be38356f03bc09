"""Where scenarios can be played: the one answer that `place`, pictures, sweeps and learners get.

A case is placed where a job plays it: cast, driven alone, and met where that was planned.
"""

from __future__ import annotations

import collections
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.futures import RESULT_STEP_S, Future, Job, PathAhead
from foretwin.contracts.scenario import EGO, Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import PathPose
from foretwin.geometry.slopes import slopes_of
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.driver_model import LEAST_START_MPS
from foretwin.sim_worker.futures.ego_alone import drive_alone
from foretwin.sim_worker.futures.ego_dry_run import rehearsal_stage, staged_cases
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.drawing import Values, draw_cases
from foretwin.sim_worker.scenarios.fitting import not_for
from foretwin.sim_worker.scenarios.placement import candidates
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.vehicle.parameters import load_vehicle


class Placement(NamedTuple):
    """Every place of a scenario in a World with its cases, and the reason for each junction
    without one.

    `cases` has for each place what became of each case that was asked for; at least one of them can
    be played.
    """

    places: tuple[ScenarioPlace, ...]
    cases: tuple[tuple[StagedCase | Unplaced, ...], ...]
    unplaced: tuple[Unplaced, ...]


def places(
    scenario: Scenario,
    world: World,
    *,
    scenes: SceneMaker | None = None,
    stage: BatchSimulation | None = None,
    vehicle: VehicleParameters | None = None,
    cases: Sequence[Values] | None = None,
    most: int | None = None,
) -> Placement:
    """Return where a scenario can be played: on the World's own junction, in a region on all.

    A place counts when one of the `cases` can be played there, those that the scenario draws unless
    given. `most` ends the search of a junction after so many places. `scenes` are the World's and
    `stage` a `rehearsal_stage` of the vehicle's, where they are at hand.
    """
    scenes = scenes or SceneMaker(world)
    stage = stage or rehearsal_stage(vehicle or load_vehicle())
    drawn = draw_cases(scenario) if cases is None else tuple(cases)
    found: list[ScenarioPlace] = []
    outcomes: list[tuple[StagedCase | Unplaced, ...]] = []
    unplaced: list[Unplaced] = []
    for junction_id, here, reason in candidates(scenario, scenes.network):
        before, failures = len(found), collections.Counter[Unplaced]()
        for place in here:
            played = playable(scenario, drawn, place, scenes, stage)
            if any(isinstance(case, StagedCase) for case in played):
                found.append(place)
                outcomes.append(played)
                if most is not None and len(found) - before >= most:
                    break
            else:
                failures.update(case for case in played if isinstance(case, Unplaced))
        if len(found) == before:
            unplaced.append(_why_not(failures, Unplaced(junction_id, reason, False)))
    return Placement(tuple(found), tuple(outcomes), tuple(unplaced))


def _why_not(failures: collections.Counter[Unplaced], otherwise: Unplaced) -> Unplaced:
    """Return the commonest failure, of those of cases that are for the roads where there are."""
    fitting = collections.Counter({f: n for f, n in failures.items() if f.applies})
    commonest = (fitting or failures).most_common(1)
    return commonest[0][0] if commonest else otherwise


def playable(
    scenario: Scenario,
    cases: Sequence[Values],
    place: ScenarioPlace,
    scenes: SceneMaker,
    stage: BatchSimulation,
) -> tuple[StagedCase | Unplaced, ...]:
    """Return each case as a job plays it at a place, or why it cannot be played there."""
    reasons = [not_for(scenario, case, place) for case in cases]
    played: list[StagedCase | Unplaced] = [
        Unplaced(place.junction_id, reason, False) for reason in reasons
    ]
    fitting = [row for row, reason in enumerate(reasons) if not reason]
    for first in range(0, len(fitting), stage.nsim):
        rows = fitting[first : first + stage.nsim]
        job = job_at(place, scenario, [cases[row] for row in rows], scenes.world)
        for at, case in staged_cases(job, stage, scenes).items():
            played[rows[at]] = case
    return tuple(played)


def job_at(
    place: ScenarioPlace,
    scenario: Scenario,
    cases: Sequence[Values],
    world: World,
    *,
    planner: str = "constant_speed",
) -> Job:
    """Return the job of cases at a place, which says where they begin; the car is anywhere."""
    motion = ("yaw_rad", "speed_mps", "yaw_rate_radps", "accel_mps2", "tire_angle_rad")
    anywhere: dict[str, Any] = dict.fromkeys(motion, 0.0)
    return Job(
        round_id=0,
        job_index=0,
        world_id=world.id,
        state=VehicleState(vehicle_id="ego", stamp_ns=0, position=world.frame.origin, **anywhere),
        path=PathAhead(xy_m=place.ego.xy_m, speed_limit_mps=place.ego.speed_limit_mps),
        futures=tuple(
            Future(
                index=index,
                name=scenario.id,
                planner=planner,
                scenario_id=scenario.id,
                values=case,
                place=place.name,
            )
            for index, case in enumerate(cases)
        ),
        horizon_s=math.ceil(scenario.horizon_s / RESULT_STEP_S - 1e-9) * RESULT_STEP_S,
        step_s=RESULT_STEP_S,
        seed=0,
        cruise_speed_mps=cases[0][f"{EGO}.speed_mps"] or LEAST_START_MPS,
        scenarios=(scenario,),
    )


def ego_alone(
    played: StagedCase,
    scenario: Scenario,
    scenes: SceneMaker,
    stage: BatchSimulation,
    time_s: Array,
) -> PathPose:
    """Return base_link of a case's ego at times (N,) since it began, as a car that keeps its speed
    and minds nobody really drives: what the planned impact was timed to."""
    stage.slopes = slopes_of(scenes.world)
    ticks = math.ceil(float(time_s.max()) / stage.control_dt_s)
    job = job_at(played.place, scenario, [played.values], scenes.world)
    (states,) = drive_alone(job, [played], stage, scenes, ticks)
    at_s = np.arange(ticks + 1) * stage.control_dt_s
    columns = states[:, 0], states[:, 1], np.unwrap(states[:, 2])
    x, y, yaw = (np.interp(time_s, at_s, column) for column in columns)
    return PathPose(np.stack([x, y], axis=-1), yaw)
