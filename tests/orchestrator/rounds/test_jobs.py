"""A round is cut into jobs that together hold every future once, and say what to measure."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import SignalState, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.instructions import RoundIntent
from foretwin.orchestrator.rounds import runner
from foretwin.orchestrator.rounds.jobs import RoundPlanner, _signals, planners_of, scenarios_of
from foretwin.orchestrator.rounds.pace import Pace
from foretwin.sim_worker.metrics.table import ROW_METRICS
from foretwin.sim_worker.scenarios.reading import catalogue
from tests.orchestrator.house import House
from tests.orchestrator.trip import town_world


@pytest.mark.parametrize(("futures", "size"), [(6, 3), (7, 3), (1, 32), (64, 32)])
def test_every_variant_is_in_one_job(futures: int, size: int, tmp_path: Path) -> None:
    house = House(tmp_path, futures=futures, futures_per_job=size)
    house.drive(20)
    assert house.conductor.start_round()
    jobs = []
    while requests := house.workers[0].take() + house.workers[1].take():
        for request in requests:
            jobs.append(request.message().decoded())
            house.workers[0].answer_one(request)
        house.settle()
    house.tables.close()

    indices = sorted(v.index for job in jobs for v in job.futures)
    assert indices == list(range(futures))
    assert max(len(job.futures) for job in jobs) <= size
    (first,) = (job for job in jobs if job.job_index == 0)
    assert first.futures[0].name == "nominal"
    assert len({(job.state.stamp_ns, job.cruise_speed_mps, job.seed) for job in jobs}) == 1
    assert house.conductor.rounds.futures.count == futures


def test_one_future_in_eight_is_driven_by_somebody_heedless() -> None:
    assert Counter(planners_of("pure_pursuit_idm")) == {
        "pure_pursuit_idm": 7, "constant_speed": 1,
    }  # fmt: skip
    assert set(planners_of("constant_speed")) == {"constant_speed"}


@pytest.mark.parametrize(("count", "jobs"), [(64, 2), (48, 2), (32, 2), (16, 1)])
def test_a_smaller_round_is_cut_into_jobs_of_one_size(
    count: int, jobs: int, tmp_path: Path
) -> None:
    house = House(tmp_path, futures=64, futures_per_job=32)
    house.conductor.rounds.pace.now = Pace(count)
    house.drive(20)
    assert house.conductor.start_round()
    asked = [r.message().decoded() for worker in house.workers for r in worker.take()]
    house.tables.close()

    assert [len(job.futures) for job in asked] == [count // jobs] * jobs


def test_a_job_says_what_is_measured_and_names_the_scenarios_of_its_futures_alone(
    tmp_path: Path,
) -> None:
    house = House(tmp_path, futures=32, futures_per_job=16)
    house.drive(20)
    assert house.conductor.start_round()
    jobs = [r.message().decoded() for worker in house.workers for r in worker.take()]
    house.tables.close()

    assert len(jobs) == 2
    for job in jobs:
        named = {future.scenario_id for future in job.futures} - {""}
        assert {scenario.id for scenario in job.scenarios} == named != set()
        assert (job.accidents, job.accident_motion) == (True, False)
        assert (job.metrics, job.step_s, job.horizon_s) == (ROW_METRICS, 0.1, 8.0)
        drive_time_s = (house.states[19].stamp_ns - house.states[0].stamp_ns) / 1e9
        assert job.drive_time_s == pytest.approx(drive_time_s)


def test_a_scenario_that_happens_at_no_junction_is_refused() -> None:
    away = next(s for s in catalogue().values() if s.where.setting != "junction")
    at = next(s for s in catalogue().values() if s.where.setting == "junction")
    config = DriveConfig(scenarios=(at.id,))
    assert scenarios_of(config) == (at,)
    with pytest.raises(
        UserError, match=f"scenario {away.id}: takes place on a {away.where.setting}"
    ):
        scenarios_of(msgspec.structs.replace(config, scenarios=(at.id, away.id)))
    every = scenarios_of(msgspec.structs.replace(config, scenarios=None))
    assert {s.where.setting for s in every} == {"junction"}
    assert at in every


def light(stamp_ns: int) -> SignalState:
    return SignalState(stamp_ns=stamp_ns, group_id="g", colour="red")


@pytest.mark.parametrize(
    ("age_ns", "fresh"),
    [(0, True), (2 * 10**9, True), (2 * 10**9 + 1, False), (-2 * 10**9, True), (-3 * 10**9, False)],
)
def test_signals_count_for_two_seconds(age_ns: int, fresh: bool) -> None:
    now_ns = 100 * 10**9
    state = VehicleState(
        vehicle_id="ego", stamp_ns=now_ns, position=GeoPoint(52.5, 13.4), yaw_rad=0.0,
        speed_mps=1.0, yaw_rate_radps=0.0, accel_mps2=0.0,
    )  # fmt: skip
    of_now, old = light(now_ns), light(now_ns - age_ns)
    assert _signals((of_now, old), state) == ((of_now, old) if fresh else (of_now,))


def test_where_a_round_runs_fewer_those_found_worst_are_among_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    house = House(tmp_path, futures=64, futures_per_job=32, least_futures=16)
    house.drive(20)
    assert house.conductor.start_round()
    asked = [(worker, r) for worker in house.workers for r in worker.take()]
    found = np.zeros(64, dtype=np.float32)
    found[[50, 33, 41]] = 1.0, 0.31, 0.9
    found[60] = 0.0
    real = runner.round_view
    monkeypatch.setattr(
        runner,
        "round_view",
        lambda *given: msgspec.structs.replace(real(*given), criticality=found),
    )
    for worker, request in asked:
        worker.answer_one(request)
    house.settle()
    played = [future for _, r in asked for future in r.message().decoded().futures]
    turns = []
    for _ in range(4):
        monkeypatch.setattr(house.conductor.rounds.pace, "now", Pace(16))
        assert house.conductor.start_round()
        some = [(worker, r) for worker in house.workers for r in worker.take()]
        turns.append([f.index for _, r in some for f in r.message().decoded().futures])
        found = np.zeros(16, dtype=np.float32)
        for place, index in enumerate(turns[-1]):
            found[place] = {50: 1.0, 33: 0.31, 41: 0.9, 60: 0.0}.get(index, 0.0)
        for worker, request in some:
            worker.answer_one(request)
        house.settle()
    house.tables.close()

    assert [future.index for future in played] == list(range(64))
    assert all({0, 33, 41, 50} <= set(turn) for turn in turns)
    assert not all(60 in turn for turn in turns)


def test_of_eight_worlds_it_is_known_what_can_happen_in_them(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    planner = RoundPlanner(house.plan.config, house.plan.vehicle)
    intent = house.mission.plan_round()
    house.tables.close()
    assert isinstance(intent, RoundIntent)
    world = town_world(intent.junction_id)
    for number in range(10):
        planner._fitting(msgspec.structs.replace(world, id=f"w{number}"), intent.path, 8.0)
    assert list(planner._known) == [f"w{number}" for number in range(2, 10)]


def test_without_scenarios_nothing_happens_in_a_future(tmp_path: Path) -> None:
    house = House(tmp_path, scenarios=())
    house.drive(20)
    assert house.conductor.start_round()
    asked = [one.message().decoded() for worker in house.workers for one in worker.take()]
    house.tables.close()
    assert asked
    assert {future.scenario_id for job in asked for future in job.futures} == {""}
