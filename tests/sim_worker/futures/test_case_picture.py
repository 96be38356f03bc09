"""Pictures of cases: what they show happens, and they name their map."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.geometry.rectangles import Rectangles, clearance
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.case_picture import caption, write_case_picture
from foretwin.sim_worker.futures.case_picture_runs import (
    Run,
    box_at,
    heedless_run,
    planned_run,
)
from foretwin.sim_worker.futures.driven_touch import off_plan_m
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.future_picture import write_future_picture
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m
from tests.sim_worker.places import crossroads, job
from tests.sim_worker.scenarios.draw_sheets import SHEETS
from tests.sim_worker.scenarios.worlds import cross, ego_alone, places

COVERS = (
    "foretwin.sim_worker.futures.case_picture_runs",
    "foretwin.sim_worker.futures.future_picture",
)

VEHICLE = load_vehicle()
PAIR = plan_futures(count=2, seed=0, planners=("pure_pursuit_idm",))
WORLD = cross()


def first_case(id_: str) -> StagedCase:
    found = places(catalogue()[id_], WORLD, most=1).cases[0]
    return next(case for case in found if isinstance(case, StagedCase))


def base_link(box: Rectangles) -> Array:
    ahead = box_centre_from_base_m(VEHICLE)
    return box.centre_m[0] - ahead * np.array([np.cos(box.yaw_rad[0]), np.sin(box.yaw_rad[0])])


def heedless(played: StagedCase) -> Run:
    scenario = catalogue()[played.place.scenario_id]
    alone = functools.partial(ego_alone, played, scenario, WORLD)
    return heedless_run(played, VEHICLE, alone, horizon_s=scenario.horizon_s)


@pytest.mark.parametrize("id_", ["scp", "occluded_pedestrian", "reversing_parking", "latency"])
def test_the_heedless_run_ends_with_the_planned_impact(id_: str) -> None:
    played = first_case(id_)
    run = heedless(played)
    assert run.collision_with == played.impact_with
    assert run.time_s[run.moment] == pytest.approx(played.impact_time_s)
    names = [actor.name for actor in played.actors]
    last = box_at(run.ego, run.moment)
    state = np.array([*base_link(last), last.yaw_rad[0]])
    assert off_plan_m(played, state, VEHICLE) <= 0.1
    gaps = [float(clearance(run.ego, other)[run.moment]) for other in run.others]
    assert gaps[names.index(played.impact_with)] <= 0.05
    assert all(gap > 0.1 for name, gap in zip(names, gaps, strict=True)
               if name != played.impact_with)  # fmt: skip


def test_a_planner_drives_the_case_from_the_same_start() -> None:
    played, scenario = first_case("lead_stopping"), catalogue()["lead_stopping"]
    kept = heedless(played)
    run = planned_run(played, scenario, WORLD, VEHICLE, planner="pure_pursuit_idm")
    np.testing.assert_allclose(run.ego.centre_m[0], kept.ego.centre_m[0], atol=0.01)
    for mine, theirs in zip(run.others, kept.others, strict=True):
        np.testing.assert_allclose(mine.centre_m[0], theirs.centre_m[0], atol=0.01)
    assert run.collision_with == ""
    assert run.clearance_m > 0.5
    assert "hits lead" in caption(played, kept, run, "pure_pursuit_idm")
    assert caption(played, kept, run, "it").endswith(f"{run.clearance_m:.1f} m to the nearest")


def test_a_case_is_drawn_with_the_name_of_its_map(tmp_path: Path) -> None:
    played, scenario = first_case("ccftap"), catalogue()["ccftap"]
    files = tmp_path / "one.png", tmp_path / "two.png"
    for file in files:
        write_case_picture(file, played, scenario, WORLD, heedless(played), None, planner="")
    assert files[0].read_bytes() == files[1].read_bytes()
    assert b"OpenStreetMap contributors" in files[0].read_bytes()


def test_a_future_is_drawn_as_it_was_driven_with_the_name_of_its_map(tmp_path: Path) -> None:
    stage, question = BatchSimulation(crossroads(), VEHICLE, nsim=2), job(PAIR, horizon_s=2.0)
    result, file = run_job(question, stage), tmp_path / "one" / "future.png"
    write_future_picture(file, question, result, 1, crossroads(), VEHICLE)
    first = file.read_bytes()
    assert b"OpenStreetMap contributors" in first
    write_future_picture(file, question, result, 0, crossroads(), VEHICLE)
    assert file.read_bytes() != first


def test_every_scenario_is_on_a_sheet() -> None:
    assert sorted(id_ for ids in SHEETS.values() for id_ in ids) == sorted(catalogue())
