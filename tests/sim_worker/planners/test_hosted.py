"""Planners of other packages: in a process of their own, whatever they do there."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Future
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.planner_interface import Planner, RemembersWithinJob
from foretwin.sim_worker.planners.hosted import (
    ANSWER_S,
    MOST_HUNG_JOBS,
    HostedDriver,
    HostedPlanner,
    PlannerFailed,
    PlannerLost,
)
from foretwin.sim_worker.planners.pure_pursuit_idm import PurePursuitIdm
from foretwin.sim_worker.planners.registry import check_planner, load_planner, planner_names
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.bus_sides import DEADLINE_S
from tests.sim_worker.places import crossroads, job
from tests.sim_worker.planners.driven import Other, at_rest_on, see, straight, view_of
from tests.sim_worker.planners.installed import install
from tests.sim_worker.planners.their_planners import CODE, NAMES
from tests.starvation import kept_waiting

COVERS = (
    "foretwin.sim_worker.planners.host_link",
    "foretwin.sim_worker.planners.host_process",
    "foretwin.sim_worker.planners.one_at_a_time",
)

VEHICLE = load_vehicle()


@pytest.fixture(scope="module", autouse=True)
def _installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    folder = tmp_path_factory.mktemp("installed")
    install(folder, "their_planners", CODE, **NAMES)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield
        for name in NAMES:
            if name in _used:
                planner = load_planner(name)
                assert isinstance(planner, HostedPlanner)
                planner.close()
        load_planner.cache_clear()


_used: set[str] = set()


def theirs(name: str) -> HostedPlanner:
    """Return a planner that has time to answer, however busy the machine is; not what blocks."""
    _used.add(name)
    planner = load_planner(name)
    assert isinstance(planner, HostedPlanner)
    planner.first_answer_s = DEADLINE_S
    planner.answer_s = ANSWER_S if name == "blocks" else DEADLINE_S
    return planner


@pytest.fixture(scope="module")
def stage() -> BatchSimulation:
    return BatchSimulation(crossroads(), VEHICLE, nsim=8)


def test_they_are_known_by_their_entry_points() -> None:
    assert set(NAMES) < set(planner_names())


def test_the_answers_are_those_of_the_same_planner_at_home() -> None:
    path = straight()
    starts = at_rest_on(path, 0.0, 7.0, count=3)
    seen, _ = see(path, [Other(np.array([[0.0, 0.0], [200.0, 0.0]]), 3.0, 40.0)], 0.0, 3)
    driver = theirs("steady").begin(3)
    for tick in range(3):
        view = view_of(path, starts, VEHICLE, time_s=0.05 * tick, users=seen)
        view = view._replace(lead_gap_m=np.array([5.0, 20.0, np.inf]))
        there, here = driver.plan(view), PurePursuitIdm().plan(view)
        assert there.accel_mps2.tobytes() == here.accel_mps2.tobytes()
        assert there.tire_angle_rad.tobytes() == here.tire_angle_rad.tobytes()


def test_one_that_remembers_is_told_when_a_job_begins() -> None:
    view = view_of(straight(), at_rest_on(straight(), 0.0, count=2), VEHICLE)
    for _ in range(2):
        driver = theirs("counting").begin(2)
        assert [float(driver.plan(view).accel_mps2[0]) for _ in range(3)] == [1.0, 2.0, 3.0]
        assert driver.remarks == {0: "asked 3 times for 2 cars"}


def test_one_for_a_single_car_is_asked_for_each_and_fails_for_each() -> None:
    path = straight()
    starts = at_rest_on(path, 10.0, 5.0, count=3)
    starts[1, 0] = 20.0
    seen, _ = see(path, [Other(np.array([[0.0, 0.0], [200.0, 0.0]]), 3.0, 40.0)], 0.0, 3)
    driver = theirs("one").begin(3)
    answer = driver.plan(view_of(path, starts, VEHICLE, users=seen))
    assert answer.accel_mps2[[0, 2]] == pytest.approx(3.0)
    assert answer.tire_angle_rad[[0, 2]] == pytest.approx(0.04)
    assert np.isnan(answer.accel_mps2[1])
    assert driver.remarks == {1: "KeyError: 'no lane here'"}


@pytest.mark.parametrize(
    ("name", "words", "lives"),
    [
        ("blocks", "gave no answer within 0.5 s and was ended", False),
        ("exits", "is gone: its process ended with code 7", False),
        ("crashes", "is gone: its process ended with code -6", False),
        ("raises", "RuntimeError: lost my way", True),
        ("scalar", "ValueError: answers of shapes () and ()", True),
        (
            "nothing",
            "ValueError: answers NoneType, not a PlannerOutput of accel_mps2 and tire_angle_rad",
            True,
        ),
        (
            "begins_nothing",
            "TypeError: begin(count) returned int: no method plan(view) or plan_one(view)",
            True,
        ),
    ],
)
def test_what_it_does_is_said_in_time_and_the_next_job_finds_it_well(
    name: str, words: str, lives: bool
) -> None:
    planner = theirs(name)
    driver = planner.begin(1)
    view = view_of(straight(), at_rest_on(straight(), 0.0), VEHICLE)
    answers = name not in ("scalar", "nothing", "begins_nothing")
    if answers:
        driver.plan(view)
    before, begun = planner.pid, time.monotonic()
    assert before is not None
    with kept_waiting(before) as kept, pytest.raises(PlannerFailed) as failure:
        driver.plan(view._replace(time_s=0.5))
    assert str(failure.value) == words
    assert time.monotonic() - begun - kept.seconds < 2.5
    assert (planner.pid == before) == lives
    if answers:
        assert np.isfinite(planner.begin(1).plan(view).accel_mps2).all()


def test_one_for_a_single_car_that_answers_nothing_is_told_what_it_should() -> None:
    driver = theirs("one_nothing").begin(1)
    assert np.isnan(driver.plan(view_of(straight(), at_rest_on(straight(), 0.0), VEHICLE))[0])
    words = "plan_one returned NoneType, not an acceleration and an angle"
    assert driver.remarks == {0: f"TypeError: {words}"}


def test_where_no_clock_runs_a_slow_one_is_waited_for_and_in_a_live_drive_it_is_late() -> None:
    planner = load_planner("late")
    _used.add("late")
    assert isinstance(planner, HostedPlanner)
    view = view_of(straight(), at_rest_on(straight(), 0.0), VEHICLE)
    assert np.isfinite(planner.begin(1).plan(view).accel_mps2).all()
    planner.keep_pace()
    late = planner.begin(1)
    with pytest.raises(PlannerFailed, match="gave no answer within 1 s and was ended"):
        late.plan(view)
    assert list(late.lost) == [0], "of what it would have answered nothing is known"


def test_who_hangs_in_every_job_is_asked_no_more_but_for_a_live_drive() -> None:
    planner = theirs("raises")
    view = view_of(straight(), at_rest_on(straight(), 0.0), VEHICLE)
    driver = planner.begin(2)
    planner._hung_jobs = MOST_HUNG_JOBS
    with pytest.raises(PlannerLost, match="hung in 5 jobs in a row and is asked no more"):
        driver.plan(view)
    planner.keep_pace()
    planner.first_answer_s = DEADLINE_S
    planner.begin(1).plan(view)
    planner.begin(1)
    assert planner._hung_jobs == 0


def test_a_blocked_process_is_really_gone() -> None:
    planner = theirs("blocks")
    planner.first_answer_s = ANSWER_S
    driver, pid = planner.begin(1), planner.pid
    assert pid is not None
    view = view_of(straight(), at_rest_on(straight(), 0.0), VEHICLE)
    with pytest.raises(PlannerFailed):
        driver.plan(view._replace(time_s=0.5))
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("no_planner", r"has no method plan\(view\), plan_one\(view\) or begin\(count\)"),
        ("fails_to_load", "fails to load: OSError: no weights"),
    ],
)
def test_one_that_does_not_load_is_refused(name: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        check_planner(name)


def test_checking_leaves_no_process() -> None:
    check_planner("steady")
    check_planner("constant_speed")
    with pytest.raises(ValueError, match="unknown planner 'nobody'"):
        check_planner("nobody")


@pytest.mark.parametrize("name", ["blocks", "crashes", "no_number"])
def test_in_a_job_only_its_own_futures_fail(stage: BatchSimulation, name: str) -> None:
    planner = theirs(name)
    assert planner.pid is not None
    futures = (
        Future(index=0, name="ours"),
        Future(index=1, name="theirs", planner=name),
        Future(index=2, name="careless", planner="constant_speed"),
    )
    begun = time.monotonic()
    with kept_waiting(planner.pid) as kept:
        together = run_job(job(futures, horizon_s=2.0), stage)
    assert time.monotonic() - begun - kept.seconds < 9.0
    assert together.outcome.valid.tolist() == [True, False, True]
    assert f"planner {name!r} at 0.5 s: " in together.outcome.failures[1]
    assert together.outcome.lost == (msgspec.UNSET if name == "no_number" else (1,))
    assert together.outcome.failures[0] == together.outcome.failures[2] == ""
    alone = run_job(job((futures[0], futures[2]), horizon_s=2.0), stage)
    assert np.array_equal(together.trajectory.states[[0, 2]], alone.trajectory.states)


def test_they_are_planners_to_the_type_checker_and_at_run_time() -> None:
    planner: Planner = theirs("steady")
    assert isinstance(planner, RemembersWithinJob)
    assert isinstance(planner.begin(1), HostedDriver)
