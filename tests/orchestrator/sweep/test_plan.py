"""The plan of a sweep: which cells there are, in which order, and how they are cut into jobs."""

from __future__ import annotations

import functools

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.orchestrator.sweep.plan import (
    PlacedHere,
    SweepPlan,
    WorldPlaces,
    cases_of,
    parameter_sets,
    planners_for,
)
from foretwin.orchestrator.sweep.spec import FUTURES_PER_JOB, Loaded, SweepSpec, check_spec
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.reading import catalogue


def _loaded(**settings: object) -> Loaded:
    return check_spec(SweepSpec(map="town.osm", **settings))  # type: ignore[arg-type]


def _places(loaded: Loaded, worlds: int = 2) -> tuple[WorldPlaces, ...]:
    return tuple(
        WorldPlaces(
            world_id=f"w{number}",
            frame=LocalFrame(GeoPoint(52.5, 13.4)),
            placed=tuple(
                PlacedHere(
                    scenario_id=scenario.id, junction_id=f"n{number}", place=f"c1/{scenario.id}",
                    ego="c1" if scenario.ego.turn == "straight" else "c2",
                )
                for scenario in loaded.scenarios
            ),
            unplaced=(),
        )
        for number in range(worlds)
    )  # fmt: skip


def test_every_combination_is_a_cell_and_each_job_is_of_one_kind() -> None:
    loaded = _loaded(
        scenarios=("scp", "ccftap", "lead_stopping"),
        planners=("constant_speed", "pure_pursuit_idm"),
        vehicles=("bmw_320i", "vw_vanagon"),
        parameters={"friction_factor": (1.0, 0.5), "target_speed_factor": (0.9, 1.0, 1.1)},
    )
    plan = SweepPlan(loaded, _places(loaded))
    cases = sum(len(cases_of(scenario, loaded.spec)) for scenario in loaded.scenarios)
    assert plan.cells == 2 * cases * 2 * 2 * 6
    jobs = list(plan.planned())
    cells = [cell for job in jobs for cell in job.cells]
    assert [cell.number for cell in cells] == list(range(len(cells)))
    assert [job.number for job in jobs] == list(range(plan.jobs))
    assert list(plan.sizes()) == [len(job.cells) for job in jobs]
    assert all(0 < len(job.cells) <= FUTURES_PER_JOB for job in jobs)
    seen = {
        (job.world.world_id, job.planner, job.vehicle, cell.scenario_id, cell.case,
         tuple(cell.parameters.items()))
        for job in jobs for cell in job.cells
    }  # fmt: skip
    assert len(seen) == len(cells)
    for job in jobs:
        turns = {catalogue()[cell.scenario_id].ego.turn for cell in job.cells}
        assert len(turns) == 1


@given(st.sets(st.integers(0, 40)))
def test_jobs_that_are_wanted_alone_are_those_of_the_whole_plan(wanted: set[int]) -> None:
    loaded, places = _small()
    plan = SweepPlan(loaded, places)
    whole = {job.number: job for job in plan.planned()}
    assert list(plan.planned(lambda number: number in wanted)) == [
        whole[number] for number in sorted(wanted & whole.keys())
    ]


@functools.cache
def _small() -> tuple[Loaded, tuple[WorldPlaces, ...]]:
    loaded = _loaded(
        scenarios=("scp", "ccftap"), parameters={"friction_factor": (1.0, 0.9, 0.8, 0.7, 0.6)}
    )
    return loaded, _places(loaded)


def test_what_is_too_long_to_be_kept_is_made_anew_with_the_same_numbers() -> None:
    scenario = msgspec.structs.replace(catalogue()["scp"], samples=6000)
    spec = SweepSpec(map="a.osm", seed=5)
    cases = cases_of(scenario, spec)
    assert cases._kept is None
    assert tuple(cases) == tuple(cases)
    assert tuple(cases) == tuple(enumerate(draw_cases(scenario, seed=5)))
    assert len(cases) == len(tuple(cases))
    few = cases_of(scenario, msgspec.structs.replace(spec, cases=4500))
    assert few._kept is None
    every = dict(cases)
    assert len({number for number, _ in few}) == 4500
    assert all(every[number] == values for number, values in few)


def test_more_cells_than_a_plan_may_have_are_refused() -> None:
    frictions = tuple(0.1 + n / 20_000 for n in range(10_000))
    speeds = tuple(0.1 + n / 20_000 for n in range(10_000))
    loaded = _loaded(
        scenarios=("scp",),
        parameters={"friction_factor": frictions, "target_speed_factor": speeds},
    )
    with pytest.raises(UserError, match=r"cells; at most 100000000: take a sample"):
        SweepPlan(loaded, _places(loaded))


def test_the_same_places_give_the_same_plan() -> None:
    loaded = _loaded(scenarios=("scp", "cpta"), cases=3, seed=7)
    first, second = (list(SweepPlan(loaded, _places(loaded)).planned()) for _ in range(2))
    assert first == second


@given(st.integers(1, 12), st.integers(0, 1000))
def test_so_many_cases_are_drawn_as_are_wished_for(wished: int, seed: int) -> None:
    scenario = catalogue()["ccftap"]
    spec = SweepSpec(map="a.osm", cases=wished, seed=seed)
    chosen = cases_of(scenario, spec)
    everything = dict(cases_of(scenario, SweepSpec(map="a.osm", seed=seed)))
    assert len(chosen) == min(wished, len(everything))
    assert [number for number, _ in chosen] == sorted({number for number, _ in chosen})
    assert all(everything[number] == values for number, values in chosen)


def test_without_parameters_there_is_one_set() -> None:
    assert tuple(parameter_sets(SweepSpec(map="a.osm"))) == ({},)


def test_only_planners_that_can_drive_backwards_do() -> None:
    both = SweepSpec(map="a.osm", planners=("pure_pursuit_idm", "reverse_pursuit"))
    forwards = SweepSpec(map="a.osm", planners=("pure_pursuit_idm",))
    bay, crossing = catalogue()["reversing_parking"], catalogue()["scp"]
    assert planners_for(bay, both) == planners_for(bay, forwards) == ("reverse_pursuit",)
    assert planners_for(crossing, both) == ("pure_pursuit_idm",)
