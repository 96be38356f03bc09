"""How episodes begin: cases of a scenario at a place, or states that a real car was in.

They are futures of a `Job` like any other, and a runner could play it; but a runner answers with
whole trajectories, while here actions come from outside between two control ticks. So the
environments cast the job's scene as `run_job` does and step it themselves (`gym.rows`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.codec import read_given
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, geo_from_local, geo_from_local_yaw
from foretwin.contracts.futures import RESULT_STEP_S, Future, Job, PathAhead
from foretwin.contracts.scenario import EGO, Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import UNKNOWN_LIMIT_MPS
from foretwin.sim_worker.futures.playable import places
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.drawing import Values, draw_cases
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.reading import find_scenario
from foretwin.sim_worker.scenarios.staged import staged_start
from foretwin.sim_worker.vehicle.seeding import local_state

CASE = "case"
BEYOND_JUNCTION_M = 20.0
"""An episode at a place ends so far behind the junction."""
_LATE = ".arrives_after_s"
_LEAST_SPEED_MPS = 4.0


class Source(NamedTuple):
    """Where episodes come from: a scenario at a place, a job, or recorded states on a path.

    World, scenario and job are given as such or as a file, scenarios also by their id in the
    catalogue. `values` fix what a scenario leaves open, named as `Scenario` tells; `place` is a
    name or a number; `cases` are drawn with `cases_seed`, and others come up to `early_or_late_s`
    before or after they would meet a car that keeps its speed. `states` lay on `path`, in the
    World's frame; with a scenario, which they do not need, each is combined with each of its cases.
    The speed aimed at is then the fastest of the states, and no less than 4 m/s.
    """

    world: World | str | Path
    scenario: Scenario | str | None = None
    values: Mapping[str, float] | None = None
    place: str | int = 0
    job: Job | str | Path | None = None
    states: Sequence[VehicleState] = ()
    path: PathAhead | None = None
    cases: int = 64
    cases_seed: int = 0
    early_or_late_s: float = 2.0

    def altered(self, options: Mapping[str, Any]) -> Source:
        """Return the source with other values; raises UserError for an unknown one."""
        for name in options:
            if name not in self._fields:
                known = ", ".join((CASE, *self._fields))
                raise UserError(f"reset knows no option {name!r}; known: {known}")
        kept = {} if not {"job", "states"} & options.keys() else {"job": None, "states": ()}
        if "scenario" in options and "states" not in options:
            kept["job"] = None
        return self._replace(**{**kept, **options})

    def episodes(self, vehicle: VehicleParameters) -> Episodes:
        """Return the episodes; raises UserError where the fields do not fit, or none can begin."""
        if not isinstance(self.cases, int | np.integer) or self.cases < 1:
            raise UserError(f"cases {self.cases!r}: a whole number from 1")
        if not 0.0 <= self.early_or_late_s < np.inf:
            raise UserError(f"early_or_late_s {self.early_or_late_s:g}: from 0")
        world = self.world
        if not isinstance(world, World):
            world = read_given(Path(world), World)
        if self.job is not None:
            job = self.job if isinstance(self.job, Job) else read_given(Path(self.job), Job)
            return _of_job(world, job)
        if len(self.states):
            return _of_states(self, world, vehicle)
        return _of_scenario(self, world, vehicle)


class Episodes(NamedTuple):
    """What episodes are drawn from: each future of a job, on its World, is one way to begin.

    All share the job's path, which ends for them at `end_arc_m`; `scenes` are the World's.
    """

    world: World
    job: Job
    end_arc_m: float
    scenes: SceneMaker


def _of_job(world: World, job: Job) -> Episodes:
    """Return the futures of a job, as recorded, as ways to begin."""
    if job.world_id != world.id:
        raise UserError(f"the job is for World {job.world_id}; given is {world.id}")
    return Episodes(world, job, FrenetPath(job.path.xy_m).length_m - 1.0, SceneMaker(world))


def _of_scenario(source: Source, world: World, vehicle: VehicleParameters) -> Episodes:
    """Return cases of a scenario at one of its places."""
    scenario = _scenario(source.scenario or "roundabout_entry")
    scenes = SceneMaker(world)
    at = _place(scenario, world, vehicle, source.place)
    if at.reverse:
        raise UserError(f"{scenario.id} is driven backwards at {at.name}; learners drive forwards")
    cases = _cases(scenario, source, source.values or {})
    played = scenes.scenarios.cast(scenario, cases, at.name, vehicle)
    begun = [
        (staged_start(one, vehicle), case)
        for case, one in zip(cases, played, strict=True)
        if not isinstance(one, Unplaced)
    ]
    if not begun:
        reason = next(one.reason for one in played if isinstance(one, Unplaced))
        raise UserError(f"{scenario.id} at {at.name}: no case can be played: {reason}")
    job = _job(
        source,
        begun,
        scenario=scenario,
        name=scenario.id,
        place=at.name,
        world_id=world.id,
        state=_somewhere(world, begun[0][0]),
        path=PathAhead(xy_m=at.ego.xy_m, speed_limit_mps=at.ego.speed_limit_mps),
        horizon_s=scenario.horizon_s,
        cruise_speed_mps=UNKNOWN_LIMIT_MPS,
    )
    end = at.ego.exit_m if at.ego.exit_m > at.ego.entry_m else at.ego.path.length_m
    return Episodes(world, job, min(end + BEYOND_JUNCTION_M, at.ego.path.length_m), scenes)


def _of_states(source: Source, world: World, vehicle: VehicleParameters) -> Episodes:
    """Return states that a real car was in on its path, alone or with a scenario's cases."""
    if source.path is None:
        raise UserError("recorded states need the path that lay ahead")
    rows = [local_state(state, world.frame, vehicle) for state in source.states]
    cruise = max(_LEAST_SPEED_MPS, *(state.speed_mps for state in source.states))
    scenario = None if source.scenario is None else _scenario(source.scenario)
    cases: Sequence[Values] = [{}]
    if scenario is not None:
        fixed = {f"{EGO}.speed_mps": cruise, **(source.values or {})}
        cases = _cases(scenario, source, fixed)
    job = _job(
        source,
        [(row, case) for row in rows for case in cases],
        scenario=scenario,
        name="recorded",
        world_id=world.id,
        state=source.states[0],
        path=source.path,
        horizon_s=8.0,
        cruise_speed_mps=cruise,
    )
    return _of_job(world, job)


def _scenario(given: Scenario | str) -> Scenario:
    return find_scenario(given) if isinstance(given, str) else given


def _job(
    source: Source,
    begun: Sequence[tuple[Array, Values]],
    *,
    scenario: Scenario | None,
    name: str,
    place: str = "",
    **fields: Any,
) -> Job:
    """Return the job of futures that begin at states (8,), each with the values of its case."""
    scenario_id = "" if scenario is None else scenario.id
    return Job(
        round_id=0,
        job_index=0,
        futures=tuple(
            Future(
                index=index,
                name=f"{name} {index}",
                scenario_id=scenario_id,
                values=case,
                place=place,
            )
            for index, (_, case) in enumerate(begun)
        ),
        step_s=RESULT_STEP_S,
        seed=source.cases_seed,
        scenarios=() if scenario is None else (scenario,),
        starts=np.array([start for start, _ in begun]),
        lights_by_plan=True,
        **fields,
    )


def _place(
    scenario: Scenario, world: World, vehicle: VehicleParameters, wanted: str | int
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


def _cases(scenario: Scenario, source: Source, values: Mapping[str, float]) -> tuple[Values, ...]:
    """Return the source's cases with `values` fixed in them, arrivals early or late."""
    rng = np.random.default_rng(source.cases_seed)
    count = source.cases
    # As many draws for each combination of listed values; so many are taken evenly.
    drawn = draw_cases(msgspec.structs.replace(scenario, samples=count), seed=source.cases_seed)
    unknown = sorted(values.keys() - drawn[0].keys())
    if unknown:
        raise UserError(f"{scenario.id} has no value {unknown[0]!r}; known: {', '.join(drawn[0])}")
    chosen = [drawn[k] for k in np.linspace(0, len(drawn) - 1, count).round().astype(int)]
    late = source.early_or_late_s * rng.uniform(-1.0, 1.0, count)
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
