"""The plan of a sweep: its cells in their one order, cut into jobs.

A pure function of the spec and of where scenarios take place: who computes a job, and with how
many others, changes nothing about it. It is walked, not kept: memory does not grow with cells.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Callable, Iterable, Iterator
from typing import Generic, NamedTuple, TypeVar

import msgspec
import numpy as np

from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import RESULT_STEP_S
from foretwin.contracts.placement import AS_RECORDED, PlacedHere, WorldPlaces
from foretwin.contracts.scenario import FAULTS, Scenario
from foretwin.orchestrator.sweep.spec import Loaded, SweepSpec, futures_per_job
from foretwin.sim_worker.planners.registry import drives_backwards
from foretwin.sim_worker.scenarios.drawing import Values, case_count, draw_cases, drawn_cases

MOST_CELLS = 100_000_000
"""A start walks all of them, at some 3 µs each, and keeps nine bytes of each job."""
BACKWARDS_PLANNER = "reverse_pursuit"
"""Drives where the ego goes backwards, unless the spec names another that does."""
_KEPT = 4096
"""So many of what is walked again and again are kept; more are made anew each time."""
_One = TypeVar("_One")


class Cell(PlacedHere, frozen=True, kw_only=True):
    """One future of a sweep; `number` counts all cells in the order of the plan."""

    number: int
    case: int
    values: dict[str, float]
    parameters: dict[str, float]


class SweepJob(msgspec.Struct, frozen=True, kw_only=True):
    """Cells that one worker plays side by side: of one World, way, vehicle and planner."""

    number: int
    world: WorldPlaces
    planner: str
    vehicle: str
    horizon_s: float
    cells: tuple[Cell, ...]


class Anew(Generic[_One]):
    """What can be walked any number of times: kept where it is short, else made anew each time."""

    def __init__(self, count: int, make: Callable[[], Iterator[_One]]) -> None:
        self._count, self._make = count, make
        self._kept = tuple(make()) if count <= _KEPT else None

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[_One]:
        return self._make() if self._kept is None else iter(self._kept)


class _Together(NamedTuple):
    """Who can be played together, and how many cells they come to."""

    world: WorldPlaces
    vehicle: str
    planner: str
    horizon_s: float
    placed: list[PlacedHere]
    cells: int
    a_job: int
    """The most cells that one job has."""


class SweepPlan:
    """All that a sweep will do; `worlds` in the order in which they were looked at, walked again
    and again.

    Raises UserError where there are too many cells.
    """

    def __init__(self, loaded: Loaded, worlds: Iterable[WorldPlaces]) -> None:
        spec = loaded.spec
        self._worlds, self._spec = worlds, spec
        self.attribution = "; ".join(sorted({world.attribution for world in worlds}))
        """Whose data the Worlds are made from."""
        self._scenarios = {scenario.id: scenario for scenario in loaded.scenarios}
        self._cases = {id_: cases_of(one, spec) for id_, one in self._scenarios.items()}
        self._sets = parameter_sets(spec)
        self.cells = self.jobs = 0
        for group in self._groups():
            self.cells += group.cells
            self.jobs += -(-group.cells // group.a_job)
        if self.cells > MOST_CELLS:
            raise UserError(
                f"the sweep has {self.cells} cells; at most {MOST_CELLS}: take a sample"
            )

    def sizes(self) -> Iterator[int]:
        """Yield how many cells each job has, in the order of the jobs."""
        for group in self._groups():
            for first in range(0, group.cells, group.a_job):
                yield min(group.a_job, group.cells - first)

    def planned(self, wanted: Callable[[int], bool] = lambda _: True) -> Iterator[SweepJob]:
        """Yield the jobs whose numbers are wanted, in their order."""
        number = first = 0
        for group in self._groups():
            cells = (
                (here, case, values, parameters)
                for here in group.placed
                for case, values in self._cases[here.scenario_id]
                for parameters in self._sets
            )
            while batch := tuple(itertools.islice(cells, group.a_job)):
                if wanted(number):
                    yield _job(number, group, first, batch)
                number, first = number + 1, first + len(batch)

    def _groups(self) -> Iterator[_Together]:
        """Yield who can be played together: places on one way, for one vehicle and planner."""
        spec = self._spec
        for world in self._worlds:
            groups: dict[tuple[str, str, str, str, float], list[PlacedHere]] = {}
            for here in world.placed:
                scenario = self._scenarios[here.scenario_id]
                for vehicle in spec.vehicles:
                    for planner in planners_for(scenario, spec):
                        horizon_s = horizon_of(scenario, spec)
                        key = here.junction_id, here.ego, vehicle, planner, horizon_s
                        groups.setdefault(key, []).append(here)
            for key in sorted(groups):
                placed = groups[key]
                cells = sum(len(self._cases[here.scenario_id]) for here in placed)
                a_job = futures_per_job(spec, key[3])
                yield _Together(world, *key[2:], placed, cells * len(self._sets), a_job)


_Batch = tuple[tuple[PlacedHere, int, Values, dict[str, float]], ...]


def _job(number: int, group: _Together, first: int, batch: _Batch) -> SweepJob:
    cells = tuple(
        Cell(
            scenario_id=here.scenario_id,
            junction_id=here.junction_id,
            place=here.place,
            ego=here.ego,
            start=here.start,
            rank=here.rank,
            number=count,
            case=case,
            values=values,
            parameters=parameters,
        )
        for count, (here, case, values, parameters) in enumerate(batch, first)
    )
    return SweepJob(
        number=number,
        world=group.world,
        planner=group.planner,
        vehicle=group.vehicle,
        horizon_s=group.horizon_s,
        cells=cells,
    )


def cases_of(scenario: Scenario, spec: SweepSpec) -> Anew[tuple[int, Values]]:
    """Return the cases of a scenario that a sweep plays, each with its number among all."""
    if scenario.id == AS_RECORDED:
        # The car drives as fast as it did.
        (values,) = draw_cases(scenario)
        own = {name: v for name, v in values.items() if name.startswith(f"{FAULTS}.")}
        return Anew(1, lambda: iter([(0, own)]))
    count = case_count(scenario)

    def every() -> Iterator[tuple[int, Values]]:
        return enumerate(drawn_cases(scenario, seed=spec.seed))

    if spec.cases == "all" or spec.cases >= count:
        return Anew(count, every)
    rng = np.random.default_rng([spec.seed, zlib.crc32(scenario.id.encode())])
    chosen = np.sort(rng.choice(count, size=spec.cases, replace=False))

    def some() -> Iterator[tuple[int, Values]]:
        places = iter(chosen.tolist())
        wanted = next(places, None)
        for index, values in every():
            if index == wanted:
                yield index, values
                wanted = next(places, None)
                if wanted is None:
                    return

    return Anew(len(chosen), some)


def parameter_sets(spec: SweepSpec) -> Anew[dict[str, float]]:
    """Return the product of all lists of parameters; one empty set where there are none."""
    names, lists = list(spec.parameters), list(spec.parameters.values())
    return Anew(
        math.prod(map(len, lists)),
        lambda: (dict(zip(names, one, strict=True)) for one in itertools.product(*lists)),
    )


def planners_for(scenario: Scenario, spec: SweepSpec) -> tuple[str, ...]:
    """Return which of the planners drive a scenario: backwards, only those that can."""
    able = tuple(name for name in spec.planners if drives_backwards(name) == scenario.ego.reverse)
    return able or ((BACKWARDS_PLANNER,) if scenario.ego.reverse else ())


def horizon_of(scenario: Scenario, spec: SweepSpec) -> float:
    """Return how long a scenario is played, in whole steps of the results."""
    wished = scenario.horizon_s if spec.horizon_s is None else spec.horizon_s
    return round(round(wished / RESULT_STEP_S) * RESULT_STEP_S, 6)
