"""How episodes begin: cases of a scenario at a place, or states that a real car was in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import read_message
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, geo_from_local, geo_from_local_yaw
from foretwin.contracts.futures import RESULT_STEP_S, Future, Job, PathAhead
from foretwin.contracts.scenario import EGO, Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import UNKNOWN_LIMIT_MPS
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.drawing import Values, draw_cases
from foretwin.sim_worker.scenarios.placement import places
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.reading import find_scenario
from foretwin.sim_worker.scenarios.staged import staged_start
from foretwin.sim_worker.vehicle.seeding import local_state

BEYOND_JUNCTION_M = 20.0
"""An episode at a place ends so far behind the junction."""
_LATE = ".arrives_after_s"
_PLANNER = "pure_pursuit_idm"


class Episodes(NamedTuple):
    """What episodes are drawn from: each future of a job, on its World, is one way to begin.

    All share the job's path, which ends for them at `end_arc_m`; `scenes` are the World's.
    """

    world: World
    job: Job
    end_arc_m: float
    scenes: SceneMaker


def read_world(world: World | str | Path) -> World:
    """Return a World, read from its file where that is what is given."""
    return world if isinstance(world, World) else read_message(Path(world), World)


def episodes_of_scenario(
    world: World | str | Path,
    scenario: Scenario | str,
    vehicle: VehicleParameters,
    *,
    values: Mapping[str, float] | None = None,
    place: str | int = 0,
    cases: int = 64,
    cases_seed: int = 0,
    early_or_late_s: float = 2.0,
) -> Episodes:
    """Return cases of a scenario, an id of the catalogue or a file, at one of its places.

    `values` fix what the scenario leaves open, named as `Scenario` tells; `cases` are drawn
    with `cases_seed`, and others come up to `early_or_late_s` before or after they would meet a
    car that keeps its speed. `place` is a name or a number. Raises UserError where the scenario,
    the place or a value is unknown, or no case can be played.
    """
    world = read_world(world)
    scenario = find_scenario(scenario) if isinstance(scenario, str) else scenario
    scenes = SceneMaker(world)
    at = _place(scenario, world, vehicle, place)
    if at.reverse:
        raise UserError(f"{scenario.id} is driven backwards at {at.name}; learners drive forwards")
    drawn = _cases(scenario, values or {}, cases, cases_seed, early_or_late_s)
    played = scenes.scenarios.cast(scenario, drawn, at.name, vehicle)
    futures: list[Future] = []
    starts: list[Array] = []
    reasons: list[str] = []
    for case, one in zip(drawn, played, strict=True):
        if isinstance(one, Unplaced):
            reasons.append(one.reason)
            continue
        name = f"{scenario.id} {len(futures)}"
        futures.append(
            Future(
                index=len(futures), name=name, planner=_PLANNER, scenario_id=scenario.id,
                values=case, place=at.name,
            )
        )  # fmt: skip
        starts.append(staged_start(one, vehicle))
    if not futures:
        raise UserError(f"{scenario.id} at {at.name}: no case can be played: {reasons[0]}")
    job = Job(
        round_id=0,
        job_index=0,
        world_id=world.id,
        state=_somewhere(world, starts[0]),
        path=PathAhead(xy_m=at.ego.xy_m, speed_limit_mps=at.ego.speed_limit_mps),
        futures=tuple(futures),
        horizon_s=scenario.horizon_s,
        step_s=RESULT_STEP_S,
        seed=cases_seed,
        cruise_speed_mps=UNKNOWN_LIMIT_MPS,
        scenarios=(scenario,),
        starts=np.array(starts),
        lights_by_plan=True,
    )
    end = at.ego.exit_m if at.ego.exit_m > at.ego.entry_m else at.ego.path.length_m
    return Episodes(world, job, min(end + BEYOND_JUNCTION_M, at.ego.path.length_m), scenes)


def episodes_of_job(world: World | str | Path, job: Job | str | Path) -> Episodes:
    """Return the futures of a job, as recorded or read from its file, as ways to begin.

    Raises UserError where the job is for another World.
    """
    world = read_world(world)
    job = job if isinstance(job, Job) else read_message(Path(job), Job)
    if job.world_id != world.id:
        raise UserError(f"the job is for World {job.world_id}; given is {world.id}")
    return Episodes(world, job, FrenetPath(job.path.xy_m).length_m - 1.0, SceneMaker(world))


def episodes_of_states(
    world: World | str | Path,
    states: Sequence[VehicleState],
    path: PathAhead,
    vehicle: VehicleParameters,
    *,
    scenario: Scenario | str | None = None,
    values: Mapping[str, float] | None = None,
    cases: int = 8,
    cases_seed: int = 0,
    early_or_late_s: float = 2.0,
    cruise_speed_mps: float | None = None,
) -> Episodes:
    """Return states that a real car was in on its path ahead, alone or with a scenario's cases.

    With a scenario each state is combined with each of its cases, which meet the car as it drives.
    `path` is in the World's frame. The speed aimed at is, unless given, the fastest of the states,
    and no less than 4 m/s. Raises UserError for no state, and as `episodes_of_scenario`.
    """
    world = read_world(world)
    if not states:
        raise UserError("no recorded state to begin episodes with")
    rows = [local_state(state, world.frame, vehicle) for state in states]
    cruise = cruise_speed_mps or max(4.0, *(state.speed_mps for state in states))
    scenario = find_scenario(scenario) if isinstance(scenario, str) else scenario
    drawn: Sequence[Values | None] = [None]
    if scenario is not None:
        fixed = {f"{EGO}.speed_mps": cruise, **(values or {})}
        drawn = _cases(scenario, fixed, cases, cases_seed, early_or_late_s)
    begun = [(row, case) for row in rows for case in drawn]
    futures = tuple(
        Future(
            index=index, name=f"recorded {index}", planner=_PLANNER,
            scenario_id="" if scenario is None else scenario.id, values=case or {},
        )
        for index, (_, case) in enumerate(begun)
    )  # fmt: skip
    job = Job(
        round_id=0,
        job_index=0,
        world_id=world.id,
        state=states[0],
        path=path,
        futures=futures,
        horizon_s=8.0,
        step_s=RESULT_STEP_S,
        seed=cases_seed,
        cruise_speed_mps=cruise,
        scenarios=() if scenario is None else (scenario,),
        starts=np.array([row for row, _ in begun]),
        lights_by_plan=True,
    )
    return episodes_of_job(world, job)


def _place(
    scenario: Scenario,
    world: World,
    vehicle: VehicleParameters,
    wanted: str | int,
) -> ScenarioPlace:
    most = wanted + 1 if isinstance(wanted, int) and wanted >= 0 else None
    found = places(scenario, world, vehicle=vehicle, most=most)
    if not found.places:
        why = found.unplaced[0].reason if found.unplaced else "it has no junction"
        raise UserError(f"{scenario.id} takes place nowhere in World {world.id}: {why}")
    names = [place.name for place in found.places]
    if isinstance(wanted, str):
        if wanted not in names:
            raise UserError(f"{scenario.id} has no place {wanted!r}; known: {', '.join(names)}")
        return found.places[names.index(wanted)]
    if not -len(names) <= wanted < len(names):
        raise UserError(f"{scenario.id} has {len(names)} places here; there is no number {wanted}")
    return found.places[wanted]


def _cases(
    scenario: Scenario,
    values: Mapping[str, float],
    count: int,
    seed: int,
    early_or_late_s: float,
) -> tuple[Values, ...]:
    """Return `count` cases with what is fixed in them, those who come early or late."""
    rng = np.random.default_rng(seed)
    # As many draws for each combination of listed values; so many are taken evenly.
    drawn = draw_cases(msgspec.structs.replace(scenario, samples=count), seed=seed)
    unknown = sorted(values.keys() - drawn[0].keys())
    if unknown:
        raise UserError(f"{scenario.id} has no value {unknown[0]!r}; known: {', '.join(drawn[0])}")
    chosen = [drawn[k] for k in np.linspace(0, len(drawn) - 1, count).round().astype(int)]
    late = early_or_late_s * rng.uniform(-1.0, 1.0, count)
    found = []
    for case, shift in zip(chosen, late, strict=True):
        times = {name: v + float(shift) for name, v in case.items() if name.endswith(_LATE)}
        found.append({**case, **times, **values})
    return tuple(found)


def _somewhere(world: World, start: Array) -> VehicleState:
    """Return a start as a measured state; jobs have one."""
    xy = start[:2]
    lat_deg, lon_deg = geo_from_local(world.frame, xy)
    return VehicleState(
        vehicle_id="learner",
        stamp_ns=0,
        position=GeoPoint(float(lat_deg), float(lon_deg)),
        yaw_rad=float(geo_from_local_yaw(world.frame, float(start[2]), xy)),
        speed_mps=float(start[3]),
        yaw_rate_radps=float(start[5]),
        accel_mps2=0.0,
        tire_angle_rad=float(start[6]),
    )
