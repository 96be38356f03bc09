"""Rounds are cut into jobs; whatever dies or comes late, every result counts once."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.futures import FuturesResult, Job, Outcome, PathAhead, Trajectory
from foretwin.orchestrator.rounds.dispatch import RoundDesk, RoundOrder
from tests.orchestrator.futures_rounds import nobody

STATE = VehicleState(
    vehicle_id="ego", stamp_ns=0, position=GeoPoint(45.0, -30.0), yaw_rad=0.0, speed_mps=5.0,
    yaw_rate_radps=0.0, accel_mps2=0.0,
)  # fmt: skip


def order(round_id: int, jobs: int = 2) -> RoundOrder:
    return RoundOrder(
        round_id=round_id,
        stamp_ns=round_id * 500_000_000,
        junction_id="j",
        world_id="w",
        receipt_mono_ns=1_000_000,
        started_mono_ns=2_000_000,
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


def test_two_workers_share_a_round() -> None:
    desk = RoundDesk()
    desk.worker_up("w0")
    desk.worker_up("w1")
    desk.open(order(0))
    given_out = desk.assignments()
    assert [(a.worker_id, a.job.job_index) for a in given_out] == [("w0", 0), ("w1", 1)]
    assert desk.result("w1", given_out[1].job, result(given_out[1].job, "w1"), 3_000_000) is None
    done = desk.result("w0", given_out[0].job, result(given_out[0].job, "w0"), 5_000_000)
    assert done is not None
    assert [r.job_index for r in done.results] == [0, 1]
    assert done.latency_ms == 4.0


def test_a_dead_workers_job_goes_to_the_other_and_counts_once() -> None:
    desk = RoundDesk()
    desk.worker_up("w0")
    desk.worker_up("w1")
    desk.open(order(0))
    lost, kept = desk.assignments()
    desk.worker_down("w0")
    assert desk.assignments() == []
    desk.result("w1", kept.job, result(kept.job, "w1"), 0)
    (again,) = desk.assignments()
    assert (again.worker_id, again.job.job_index) == ("w1", 0)
    assert desk.result("w1", again.job, result(again.job, "w1"), 0) is not None
    # What the dead worker had sent before it died arrives after all.
    assert desk.result("w0", lost.job, result(lost.job, "w0"), 0) is None
    assert (desk.late_results, desk.requeued_jobs) == (1, 1)


def test_a_failed_job_is_tried_again() -> None:
    desk = RoundDesk()
    desk.worker_up("w0")
    desk.open(order(0, jobs=1))
    (first,) = desk.assignments()
    assert desk.result("w0", first.job, None, 0) is None
    (second,) = desk.assignments()
    assert second.job is first.job


def test_a_round_whose_jobs_are_refused_again_and_again_is_given_up() -> None:
    desk = RoundDesk()
    desk.worker_up("w0")
    desk.open(order(0, jobs=1))
    for _ in range(3):
        (given_out,) = desk.assignments()
        desk.result("w0", given_out.job, None, 0, refused=True)
    assert desk.open_rounds == ()
    assert desk.given_up_rounds == 1
    desk.open(order(1, jobs=1))
    assert len(desk.assignments()) == 1


def test_a_worker_that_does_not_answer_gives_no_round_up() -> None:
    desk = RoundDesk()
    desk.worker_up("w0")
    desk.open(order(0, jobs=1))
    for _ in range(20):
        (given_out,) = desk.assignments()
        desk.result("w0", given_out.job, None, 0)
    assert desk.open_rounds == (0,)


def test_a_dropped_round_frees_the_desk_and_its_results_are_late() -> None:
    desk = RoundDesk()
    desk.worker_up("w0")
    desk.open(order(0))
    (started,) = desk.assignments()
    desk.drop()
    desk.open(order(1, jobs=1))
    assert desk.assignments() == []  # still at work
    assert desk.result("w0", started.job, result(started.job, "w0"), 0) is None
    (fresh,) = desk.assignments()
    assert fresh.job.round_id == 1
    assert desk.late_results == 1


@given(st.lists(st.sampled_from(["die0", "die1", "back0", "back1", "answer0", "answer1"])))
def test_no_order_of_deaths_loses_or_doubles_a_result(events: list[str]) -> None:
    desk = RoundDesk()
    desk.worker_up("w0")
    desk.worker_up("w1")
    desk.open(order(0, jobs=4))
    at_work: dict[str, Job] = {}
    finished = []

    def give() -> None:
        for assignment in desk.assignments():
            at_work[assignment.worker_id] = assignment.job

    def answer(worker_id: str) -> None:
        job = at_work.pop(worker_id, None)
        if job is not None:
            done = desk.result(worker_id, job, result(job, worker_id), 0)
            finished.extend([done] if done else [])

    give()
    for event in [*events, "back0", "back1", *["answer0", "answer1"] * 4]:
        what, worker_id = event[:-1], f"w{event[-1]}"
        if what == "die":
            at_work.pop(worker_id, None)
            desk.worker_down(worker_id)
        elif what == "back":
            at_work.pop(worker_id, None)
            desk.worker_up(worker_id)
        else:
            answer(worker_id)
        give()
    assert len(finished) == 1
    assert [r.job_index for r in finished[0].results] == [0, 1, 2, 3]
