"""Driving stacks that a worker starts: asked in simulated time, in processes of their own."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Future, FuturesResult, PlannerTiming
from foretwin.contracts.planner_link import PlannerJoined
from foretwin.contracts.setup import StackSetup
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.planner_interface import PlayAgain
from foretwin.sim_worker.planners.hosted import MOST_HUNG_JOBS
from foretwin.sim_worker.planners.stack import ATTEMPTS, StackPlanner
from foretwin.sim_worker.planners.stack_processes import MOST_FAILED_STARTS
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.contracts.bus_sides import DEADLINE_S
from tests.sim_worker.places import crossroads, job
from tests.system.foretwin_command import REPOSITORY

COVERS = ("foretwin.sim_worker.planners.stack_processes",)

MODULE = "tests.sim_worker.planners.a_stack"
VEHICLE = load_vehicle()


@pytest.fixture(autouse=True)
def _finds_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))


@contextmanager
def stack(folder: Path, how: str, *words: str, **setup: object) -> Iterator[StackPlanner]:
    """A stack of `a_stack` for one worker."""
    given: dict[str, object] = {"answer_within_s": DEADLINE_S, "start_within_s": DEADLINE_S}
    command = (sys.executable, "-m", MODULE, how, *words)
    planner = StackPlanner(
        "mine", StackSetup(command=command, **(given | setup)), folder=folder, owner="w0"
    )
    try:
        yield planner
    finally:
        planner.close()


def played(
    planner: StackPlanner,
    *,
    count: int = 2,
    seed: int = 0,
    again: bool = True,
    **job_fields: object,
) -> FuturesResult:
    """Play futures of the stack and one of another planner, as a worker does."""
    futures = [Future(index=n, name=f"f{n}", planner="mine") for n in range(count)]
    others = [Future(index=count, name="other", planner="constant_speed")]
    asked = msgspec.structs.replace(job((*futures, *others), horizon_s=2.0), seed=seed)
    asked = msgspec.structs.replace(asked, **job_fields)
    while True:
        try:
            stage = BatchSimulation(crossroads(), VEHICLE, nsim=len(asked.futures))
            return run_job(asked, stage, stacks={"mine": planner})
        except PlayAgain:
            if not again:
                raise


def test_cars_go_where_it_says_whatever_it_takes_of_wall_time(tmp_path: Path) -> None:
    with stack(tmp_path, "straight") as planner, stack(tmp_path, "slow") as slow:
        at_once, late = played(planner), played(slow)
    assert at_once.outcome.valid.all()
    assert at_once.trajectory.states[:2, -1, 3] == pytest.approx(6.0, abs=0.5)
    assert result_digest(at_once) == result_digest(late)


def test_a_latency_is_of_simulated_time_and_changes_what_is_driven(tmp_path: Path) -> None:
    with stack(tmp_path, "straight") as planner:
        known = {
            latency_s: result_digest(
                played(planner, planner_timing=PlannerTiming(latency_s=latency_s))
            )
            for latency_s in (0.0, 0.3, 0.0)
        }
    assert known[0.0] != known[0.3]


def test_each_process_of_one_that_remembers_drives_a_future_of_its_own(tmp_path: Path) -> None:
    with stack(tmp_path, "remembers", instances=2) as planner:
        first, second = played(planner, seed=1), played(planner, seed=1)
        assert len(planner.processes.pids) == 2
    assert first.outcome.valid.all()
    assert result_digest(first) == result_digest(second), "a reset leaves nothing"
    assert abs(np.diff(first.trajectory.states[:2, -1, 3])[0]) > 0.5, "each by its own seed"


def test_whose_process_dies_has_its_job_played_again(tmp_path: Path) -> None:
    with stack(tmp_path, "straight") as planner:
        plain = played(planner)
    with stack(tmp_path, "dies", str(tmp_path / "died")) as planner:
        with pytest.raises(PlayAgain, match=r"ended by exit code 3 \(the sky is falling\)"):
            played(planner, again=False)
        assert result_digest(played(planner)) == result_digest(plain)


def test_who_always_dies_of_a_job_fails_its_futures_alone(tmp_path: Path) -> None:
    with stack(tmp_path, "dies") as planner:
        result = played(planner)
        assert planner.processes.process_id(0).endswith(f"-{ATTEMPTS}")
    assert result.outcome.valid.tolist() == [False, False, True]
    assert result.outcome.lost == (0, 1)
    assert result.outcome.failures[0] == (
        f"planner 'mine' at 0.4 s: {ATTEMPTS} of its processes died of the job, the last ended by "
        "exit code 3 (the sky is falling)"
    )


def test_who_hangs_fails_what_it_drives_and_is_started_anew(tmp_path: Path) -> None:
    mark = str(tmp_path / "hung")
    with stack(tmp_path, "straight") as planner:
        plain = played(planner, seed=1)
    with stack(tmp_path, "hangs", mark, answer_within_s=1.0) as planner:
        hung = played(planner)
        planner.processes._setup = msgspec.structs.replace(
            planner.processes._setup, answer_within_s=DEADLINE_S
        )
        after = played(planner, seed=1)
    assert hung.outcome.lost == (0, 1)
    words = "planner 'mine' at 0.4 s: gave no answer within 1 s of wall time and was ended"
    assert hung.outcome.failures == (words, words, "")
    assert result_digest(after) == result_digest(plain)


def test_one_process_that_hangs_takes_its_own_futures_alone(tmp_path: Path) -> None:
    within = {"answer_within_s": 3.0, "instances": 2}
    with stack(tmp_path, "hangs_for_the_second", **within) as planner:
        assert played(planner).outcome.lost == (1,)


def test_who_talks_on_without_an_answer_has_no_more_time(tmp_path: Path) -> None:
    with stack(tmp_path, "talks", answer_within_s=1.0) as planner:
        result = played(planner)
    assert result.outcome.lost == (0, 1)
    words = result.outcome.failures[0]
    assert "gave no answer within 1 s of wall time and was ended; it answered question 0 " in words
    assert "where question 5 of job 0 was asked" in words


def test_who_hangs_in_every_job_is_asked_no_more(tmp_path: Path) -> None:
    with stack(tmp_path, "straight") as planner:
        planner.hung_jobs = MOST_HUNG_JOBS
        result = played(planner)
        assert not planner.processes.pids
    assert result.outcome.lost == (0, 1)
    assert f"hung in {MOST_HUNG_JOBS} jobs in a row" in result.outcome.failures[0]


@pytest.mark.parametrize(
    ("how", "failed", "words"),
    [
        ("raises", [0, 1], "ValueError: no way to go"),
        ("shapes", [0, 1], "yaw_rad of shape (1, 7) for 2 futures"),
        ("no_number", [0], "the answer holds what is no number"),
        ("leaves_out", [1], "the answer left it out"),
        ("garbage", [0, 1], "answers what is no answer: "),
    ],
)
def test_an_answer_of_no_use_fails_its_futures_with_one_line(
    how: str, failed: list[int], words: str, tmp_path: Path
) -> None:
    with stack(tmp_path, how) as planner:
        outcome = played(planner).outcome
    assert np.flatnonzero(~outcome.valid).tolist() == failed
    assert outcome.lost is msgspec.UNSET, "that is what it answers"
    for row in failed:
        said = outcome.failures[row]
        # Garbage goes by a link of its own, and may come after the answer, at the next question.
        instants = ("0.4", "0.5") if how == "garbage" else ("0.4",)
        assert said.startswith(tuple(f"planner 'mine' at {at} s: {words}" for at in instants))
        assert "\n" not in outcome.failures[row]


def test_where_a_car_would_be_after_its_motion_is_not_made_up(tmp_path: Path) -> None:
    with stack(tmp_path, "ends") as planner:
        outcome = played(planner).outcome
    why = "its motion ended at 0.43 s, not at rest, before another one counted"
    assert outcome.failures[:2] == (f"planner 'mine' at 0.45 s: {why}",) * 2


@pytest.mark.parametrize(
    ("how", "setup", "words"),
    [
        ("silent", {"start_within_s": 0.5}, "did not join within 0.5 s and was ended"),
        ("old", {}, "it speaks version 1 of the planner link, this foretwin version 2: update"),
        (
            "straight",
            {"says": PlannerJoined(name="straight", version="0")},
            "it says that it is straight 1; when the sweep began it was straight 0",
        ),
    ],
)
def test_who_cannot_be_asked_is_named(
    how: str, setup: dict[str, object], words: str, tmp_path: Path
) -> None:
    with stack(tmp_path, how, **setup) as planner:
        outcome = played(planner).outcome
    assert outcome.lost == (0, 1)
    assert outcome.failures[0].startswith(f"planner 'mine' at 0 s: {words}")


def test_what_cannot_be_started_is_not_tried_for_ever(tmp_path: Path) -> None:
    missing = StackSetup(command=("/no/such/stack",))
    planner = StackPlanner("mine", missing, folder=tmp_path, owner="w0")
    try:
        told = [played(planner).outcome.failures[0] for _ in range(MOST_FAILED_STARTS + 1)]
    finally:
        planner.close()
    once = "ended by exit code 127 (/no/such/stack: no such file or directory) before it joined"
    assert once in told[0]
    assert told[-2] == told[-1]
    assert f"{MOST_FAILED_STARTS} times: it is not started any more" in told[-1]
