"""Rounds are cut into jobs and put together again from what becomes of these."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.futures import FuturesResult, Job, Outcome, PathAhead, Trajectory
from foretwin.contracts.runner import Answer, JobAnswer
from foretwin.orchestrator.runner.open_rounds import (
    OpenRounds,
    RoundDone,
    RoundGivenUp,
    RoundOrder,
)
from tests.orchestrator.futures_rounds import nobody

STATE = VehicleState(
    vehicle_id="ego", stamp_ns=0, position=GeoPoint(45.0, -30.0), yaw_rad=0.0, speed_mps=5.0,
    yaw_rate_radps=0.0, accel_mps2=0.0,
)  # fmt: skip


def order(round_id: int, jobs: int = 2, *, deadline_ns: int | None = None) -> RoundOrder:
    return RoundOrder(
        round_id=round_id,
        stamp_ns=round_id * 500_000_000,
        junction_id="j",
        world_id="w",
        receipt_mono_ns=1_000_000,
        started_mono_ns=2_000_000,
        deadline_mono_ns=deadline_ns,
        jobs=tuple(
            Job(
                round_id=round_id, job_index=index, world_id="w", state=STATE,
                path=PathAhead(xy_m=np.zeros((2, 2)), speed_limit_mps=np.ones(2)), futures=(),
                horizon_s=8.0, step_s=0.1, seed=0, cruise_speed_mps=5.0,
            )
            for index in range(jobs)
        ),
    )  # fmt: skip


def result(job: Job, worker_id: str) -> FuturesResult:
    none = np.zeros(0)
    return FuturesResult(
        round_id=job.round_id, job_index=job.job_index, worker_id=worker_id, world_id="w",
        future_indices=(),
        trajectory=Trajectory(
            stamp_ns=0, time_s=none, states=np.zeros((0, 0, 8), dtype=np.float32)
        ),
        road_users=nobody(0, 0),
        metrics={},
        accidents=(),
        left_out=(),
        outcome=Outcome(
            collided=none, collision_time_s=none, collision_with=none, min_clearance_m=none,
            progress_m=none, valid=none,
        ),
        sim_seconds=1.0, cpu_seconds=0.1, wall_seconds=0.1,
    )  # fmt: skip


def answer(order: RoundOrder, index: int, *, at_ns: int = 0, failure: str = "") -> Answer:
    message = None if failure else JobAnswer(result=result(order.jobs[index], "w0"))
    return Answer(order.tasks[index], message, failure, "w0", at_ns)


def test_a_round_is_complete_with_its_last_result_in_the_order_of_its_jobs() -> None:
    rounds, asked = OpenRounds(), order(0, jobs=3)
    rounds.open(asked)
    assert [task.key for task in asked.tasks] == [named.sha256 for named in asked.recorded]
    assert rounds.take(answer(asked, 2)) is None
    assert rounds.take(answer(asked, 0)) is None
    assert rounds
    done = rounds.take(answer(asked, 1, at_ns=5_000_000))
    assert isinstance(done, RoundDone)
    assert [r.job_index for r in done.results] == [0, 1, 2]
    assert (done.latency_ms, done.seconds) == (4.0, 0.003)
    assert not rounds


@pytest.mark.parametrize(("at_ns", "late"), [(5_000_000, False), (5_000_001, True)])
def test_a_round_whose_last_result_comes_after_its_deadline_is_late(at_ns: int, late: bool) -> None:
    rounds, asked = OpenRounds(), order(0, deadline_ns=5_000_000)
    rounds.open(asked)
    rounds.take(answer(asked, 0, at_ns=1))
    done = rounds.take(answer(asked, 1, at_ns=at_ns))
    assert isinstance(done, RoundDone)
    assert done.late is late


def test_without_a_deadline_nothing_is_late() -> None:
    rounds, asked = OpenRounds(), order(0, jobs=1)
    rounds.open(asked)
    done = rounds.take(answer(asked, 0, at_ns=10**18))
    assert isinstance(done, RoundDone)
    assert not done.late


def test_a_round_ends_with_a_job_that_is_given_up() -> None:
    rounds, asked = OpenRounds(), order(0)
    rounds.open(asked)
    rounds.take(answer(asked, 0))
    ended = rounds.take(answer(asked, 1, failure="no path"))
    assert ended == RoundGivenUp(asked)
    assert not rounds


def test_what_comes_of_a_round_that_was_dropped_completes_nothing() -> None:
    rounds, late, fresh = OpenRounds(), order(0, jobs=1), order(1, jobs=1)
    rounds.open(late)
    assert rounds.drop() == (late,)
    rounds.open(fresh)
    assert rounds.take(answer(late, 0)) is None
    assert rounds
    assert isinstance(rounds.take(answer(fresh, 0)), RoundDone)
