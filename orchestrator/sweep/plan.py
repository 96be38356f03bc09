"""The plan of a sweep: its cells in their one order, cut into jobs.

A pure function of the spec and of where scenarios take place: who computes a job, and with how
many others, changes nothing about it.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Iterator, Mapping, Sequence

import msgspec
import numpy as np

from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import RESULT_STEP_S
from foretwin.contracts.placement import AS_RECORDED, PlacedHere, WorldPlaces
from foretwin.contracts.scenario import FAULTS, Scenario
from foretwin.orchestrator.sweep.spec import Loaded, SweepSpec, futures_per_job
from foretwin.sim_worker.planners.registry import drives_backwards
from foretwin.sim_worker.scenarios.drawing import Values, draw_cases

MOST_CELLS = 5_000_000
BACKWARDS_PLANNER = "reverse_pursuit"
"""Drives where the ego goes backwards, unless the spec names another that does."""


class Cell(PlacedHere, frozen=True, kw_only=True):
    """One future of a sweep; `number` counts all cells in the order of the plan."""

    number: int
    case: int
    values: dict[str, float]
    parameters: dict[str, float]


class SweepJob(msgspec.Struct, frozen=True, kw_only=True):
    """Cells that one worker plays side by side: of one World, way, vehicle and planner."""

    number: int
    world_id: str
    planner: str
    vehicle: str
    horizon_s: float
    cells: tuple[Cell, ...]


class SweepPlan(msgspec.Struct, frozen=True, kw_only=True):
    """All that a sweep will do; `worlds` in the order in which they were looked at."""

    worlds: tuple[WorldPlaces, ...]
    jobs: tuple[SweepJob, ...]

    @property
    def attribution(self) -> str:
        """Return whose data the Worlds are made from."""
        return "; ".join(sorted({world.attribution for world in self.worlds}))

    @property
    def cells(self) -> int:
        """Return how many futures there are."""
        return sum(len(job.cells) for job in self.jobs)


def cases_of(scenario: Scenario, spec: SweepSpec) -> tuple[tuple[int, Values], ...]:
    """Return the cases of a scenario that a sweep plays, each with its number among all."""
    if scenario.id == AS_RECORDED:
        # The car drives as fast as it did.
        (values,) = draw_cases(scenario)
        return ((0, {name: v for name, v in values.items() if name.startswith(f"{FAULTS}.")}),)
    cases = tuple(enumerate(draw_cases(scenario, seed=spec.seed)))
    if spec.cases == "all" or spec.cases >= len(cases):
        return cases
    rng = np.random.default_rng([spec.seed, zlib.crc32(scenario.id.encode())])
    chosen = sorted(rng.choice(len(cases), size=spec.cases, replace=False).tolist())
    return tuple(cases[index] for index in chosen)


def parameter_sets(spec: SweepSpec) -> tuple[dict[str, float], ...]:
    """Return the product of all lists of parameters; one empty set where there are none."""
    names = list(spec.parameters)
    return tuple(
        dict(zip(names, values, strict=True))
        for values in itertools.product(*spec.parameters.values())
    )


def planners_for(scenario: Scenario, spec: SweepSpec) -> tuple[str, ...]:
    """Return which of the planners drive a scenario: backwards, only those that can."""
    able = tuple(name for name in spec.planners if drives_backwards(name) == scenario.ego.reverse)
    return able or ((BACKWARDS_PLANNER,) if scenario.ego.reverse else ())


def horizon_of(scenario: Scenario, spec: SweepSpec) -> float:
    """Return how long a scenario is played, in whole steps of the results."""
    wished = scenario.horizon_s if spec.horizon_s is None else spec.horizon_s
    return round(round(wished / RESULT_STEP_S) * RESULT_STEP_S, 6)


def plan_sweep(loaded: Loaded, worlds: Sequence[WorldPlaces]) -> SweepPlan:
    """Return the plan of a sweep over Worlds; UserError where it would have too many cells."""
    spec = loaded.spec
    scenarios = {scenario.id: scenario for scenario in loaded.scenarios}
    cases = {id_: cases_of(scenario, spec) for id_, scenario in scenarios.items()}
    sets = parameter_sets(spec)
    count = sum(
        len(cases[p.scenario_id]) * len(planners_for(scenarios[p.scenario_id], spec))
        for world in worlds
        for p in world.placed
    )
    count *= len(sets) * len(spec.vehicles)
    if count > MOST_CELLS:
        raise UserError(f"the sweep has {count} cells; at most {MOST_CELLS}: take a sample")
    jobs: list[SweepJob] = []
    number = itertools.count()
    for world in worlds:
        for (vehicle, planner, horizon_s), placed in _groups(world, scenarios, spec):
            cells = (
                Cell(
                    **msgspec.structs.asdict(here),
                    number=next(number),
                    case=case,
                    values=values,
                    parameters=parameters,
                )
                for here in placed
                for case, values in cases[here.scenario_id]
                for parameters in sets
            )
            most = futures_per_job(spec, planner)
            while batch := tuple(itertools.islice(cells, most)):
                job = SweepJob(
                    number=len(jobs),
                    world_id=world.world_id,
                    planner=planner,
                    vehicle=vehicle,
                    horizon_s=horizon_s,
                    cells=batch,
                )
                jobs.append(job)
    return SweepPlan(worlds=tuple(worlds), jobs=tuple(jobs))


def _groups(
    world: WorldPlaces, scenarios: Mapping[str, Scenario], spec: SweepSpec
) -> Iterator[tuple[tuple[str, str, float], list[PlacedHere]]]:
    """Yield who can be played together: places on one way, for one vehicle and planner."""
    groups: dict[tuple[str, str, str, str, float], list[PlacedHere]] = {}
    for here in world.placed:
        scenario = scenarios[here.scenario_id]
        for vehicle in spec.vehicles:
            for planner in planners_for(scenario, spec):
                key = (here.junction_id, here.ego, vehicle, planner, horizon_of(scenario, spec))
                groups.setdefault(key, []).append(here)
    for key in sorted(groups):
        yield (key[2], key[3], key[4]), groups[key]
