from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.futures import Future
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView, ViewOfSome
from foretwin.sim_worker.planners import registry
from foretwin.sim_worker.planners.built_in import BUILT_IN
from foretwin.sim_worker.planners.registry import load_planner, planner_names
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import crossroads, happening, job, state_at, turning_path

COVERS = (
    "foretwin.sim_worker.planner_interface",
    "foretwin.sim_worker.planners.constant_speed",
    "foretwin.sim_worker.planners.pure_pursuit_idm",
    "foretwin.sim_worker.planners.built_in",
    "foretwin.sim_worker.planners.registry",
)


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(crossroads(), load_vehicle(), nsim=8)


def test_built_in_planners_are_known_without_installation() -> None:
    assert planner_names()[:2] == ("pure_pursuit_idm", "constant_speed")
    assert load_planner("constant_speed") is load_planner("constant_speed")


def test_an_unknown_planner_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"unknown planner 'magic'; one of pure_pursuit_idm, con"):
        load_planner("magic")


class _Coasting:
    def plan(self, view: PlannerView) -> PlannerOutput:
        return PlannerOutput(np.zeros_like(view.arc_m), np.zeros_like(view.arc_m))


class _Scalar:
    def plan(self, view: PlannerView) -> PlannerOutput:
        return PlannerOutput(np.zeros(1), np.zeros(1))


def test_the_registry_names_the_classes_there_are_and_which_of_them_drive_backwards() -> None:
    backwards = {name: getattr(kind, "drives_backwards", False) for name, kind in BUILT_IN.items()}
    assert backwards == registry._OWN


@pytest.fixture
def offered(monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    """Planners in this process; tests/sim_worker/planners/test_hosted.py has those of packages."""

    def offer(kind: object) -> None:
        monkeypatch.setitem(registry._OWN, "theirs", False)
        monkeypatch.setitem(BUILT_IN, "theirs", kind)
        load_planner.cache_clear()

    yield offer
    load_planner.cache_clear()


def test_a_planner_drives_the_futures_that_name_it(offered, stage: BatchSimulation) -> None:  # type: ignore[no-untyped-def]
    offered(_Coasting)
    assert planner_names()[-1] == "theirs"
    futures = (Future(index=0, name="a"), Future(index=1, name="b", planner="theirs"))
    result = run_job(job(futures, cruise=12.0), stage)
    assert result.outcome.progress_m[1] == pytest.approx(64.0, abs=0.1)
    assert result.outcome.progress_m[0] > 70.0


def test_a_planner_of_the_wrong_shape_is_named(offered, stage: BatchSimulation) -> None:  # type: ignore[no-untyped-def]
    offered(_Scalar)
    futures = tuple(Future(index=i, name="x", planner="theirs") for i in range(3))
    outcome = run_job(job((*futures, Future(index=3, name="ours"))), stage).outcome
    assert outcome.valid.tolist() == [False, False, False, True]
    assert "planner 'theirs' at 0 s: ValueError: answers of shapes (1,)" in outcome.failures[0]
    assert outcome.failures[3] == ""


class _Raises:
    def plan(self, view: PlannerView) -> PlannerOutput:
        if view.time_s >= 1.0:
            raise KeyError("no such lane")
        return PlannerOutput(np.zeros_like(view.arc_m), np.zeros_like(view.arc_m))


def test_a_planner_that_raises_fails_its_futures_and_no_others(
    offered, stage: BatchSimulation
) -> None:  # type: ignore[no-untyped-def]
    offered(_Raises)
    futures = (Future(index=0, name="ours"), Future(index=1, name="x", planner="theirs"))
    alone = run_job(job(futures[:1]), stage)
    together = run_job(job(futures), stage)
    assert together.outcome.valid.tolist() == [True, False]
    assert together.outcome.failures == ("", "planner 'theirs' at 1 s: KeyError: 'no such lane'")
    assert together.trajectory.states[0] == pytest.approx(alone.trajectory.states[0], abs=1e-6)
    assert np.isfinite(together.trajectory.states).all()


def test_the_driver_reaches_and_keeps_the_cruise_speed(stage: BatchSimulation) -> None:
    result = run_job(job((Future(index=0, name="n"),), state=state_at(-50, -1.5, speed=4.0)), stage)
    speed = result.trajectory.states[0, :, 3]
    assert speed[-1] == pytest.approx(8.0, abs=0.6)
    assert speed.max() < 8.1


def test_the_driver_slows_for_a_curve_and_stays_on_its_path(stage: BatchSimulation) -> None:
    result = run_job(
        job((Future(index=0, name="n"),), path=turning_path(), cruise=10.0,
            state=state_at(-30.0, -1.5, speed=10.0)),
        stage,
    )  # fmt: skip
    states = result.trajectory.states[0]
    assert states[-1, 2] == pytest.approx(np.pi / 2, abs=0.1)
    lateral = np.abs(states[:, 3] * states[:, 5])
    assert 1.5 < lateral.max() < 4.0
    on_circle = (states[:, 0] > 3.0) & (states[:, 1] < 7.5)
    radius = np.hypot(states[on_circle, 0], states[on_circle, 1] - 10.5)
    assert radius == pytest.approx(np.full(len(radius), 12.0), abs=0.6)


def test_the_driver_stops_behind_a_standing_lead_and_the_careless_one_does_not(
    stage: BatchSimulation,
) -> None:
    lead = {"lead__speed_mps": 0.0, "lead__gap_m": 30.0}
    futures = (
        happening(0, "lead_stopping", **lead),
        happening(1, "lead_stopping", planner="constant_speed", **lead),
        Future(index=2, name="alone"),
    )
    outcome = run_job(job(futures, horizon_s=16.0), stage).outcome
    assert outcome.collided.tolist() == [False, True, False]
    assert outcome.collision_with.tolist() == [0, 1, 0]
    assert outcome.collision_time_s[1] == pytest.approx(30.0 / 8.0, abs=0.1)
    assert 1.0 < outcome.min_clearance_m[0] < 3.5
    assert outcome.min_clearance_m[1] == 0.0
    assert np.isinf(outcome.min_clearance_m[2])


@pytest.mark.parametrize("planner", ["pure_pursuit_idm", "constant_speed"])
def test_a_car_with_nothing_to_do_stands_still(stage: BatchSimulation, planner: str) -> None:
    future = Future(index=0, name="n", planner=planner)
    result = run_job(job((future,), state=state_at(-50, -1.5, speed=0.0), cruise=0.0), stage)
    states = result.trajectory.states[0]
    assert np.abs(states[:, :2] - states[0, :2]).max() < 1e-3


@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_a_car_across_its_path_with_wheels_turned_rejoins_it_without_a_loop(
    stage: BatchSimulation, speed: float
) -> None:
    limit = stage.vehicle.max_tire_angle_rad.value
    planners = ("pure_pursuit_idm", "constant_speed")
    futures = tuple(Future(index=i, name="n", planner=name) for i, name in enumerate(planners))
    for degrees in (-60, -30, 0, 30, 60):
        for tire in (-limit, limit):
            state = state_at(-50, -1.5, np.radians(degrees), speed, tire_angle=tire)
            driven = run_job(job(futures, state=state, horizon_s=16.0), stage)
            assert (driven.outcome.progress_m > 60.0).all()
            for states in driven.trajectory.states:
                assert np.degrees(np.ptp(np.unwrap(states[:, 2]))) < abs(degrees) + 50
                assert np.abs(states[:, 3] * states[:, 5]).max() < 2.5
                assert states[-1, 1] == pytest.approx(-1.5, abs=0.1)
                assert states[-1, 2] == pytest.approx(0.0, abs=0.03)


def test_who_drives_some_cars_is_shown_these_at_each_tick() -> None:
    path, each = FrenetPath(turning_path().xy_m), np.array([1.0, 2.0, 3.0])
    view = PlannerView(
        0.0, np.arange(24.0).reshape(3, 8), path, each, each, each, each, each, each, each,
        load_vehicle(),
    )  # fmt: skip
    rows = np.array([2, 0])
    some = ViewOfSome(rows)
    before = some.of(view)
    assert before.states.tolist() == view.states[rows].tolist()
    assert before.target_speed_mps.tolist() == [3.0, 1.0]
    assert some.of(view).target_speed_mps is before.target_speed_mps, "it has not changed"
    later = some.of(view._replace(target_speed_mps=np.array([4.0, 5.0, 6.0])))
    assert later.target_speed_mps.tolist() == [6.0, 4.0]
