"""Sweeps as events, where the outcome can be told by hand."""

from __future__ import annotations

import msgspec
import pytest

from tests.scale.sweep_model import JobShape, SweepCosts, SweepModel, in_worlds

FREE_PARENT = SweepCosts(
    job_s=0.1, future_s=0.01, first_s=0.0, parent_job_s=0.0, parent_future_s=0.0,
    between_s=0.0, contention=0.0,
)  # fmt: skip


def test_two_workers_halve_the_time_where_nothing_is_shared() -> None:
    jobs = in_worlds(20, worlds=2, futures=10)
    one, two = (SweepModel(FREE_PARENT, workers=n, cores=2).play(jobs) for n in (1, 2))
    assert one.wall_s == pytest.approx(20 * 0.2)
    assert two.wall_s == pytest.approx(10 * 0.2)
    assert (one.jobs_cpu_s, two.jobs_cpu_s) == pytest.approx((4.0, 4.0))
    assert two.idle_share == pytest.approx(0.0)


def test_the_last_job_of_an_odd_number_leaves_a_worker_idle() -> None:
    three = SweepModel(FREE_PARENT, workers=2, cores=2).play([JobShape("a", 0)] * 3)
    assert three.wall_s == pytest.approx(0.2)
    assert three.idle_share == pytest.approx(0.25)


def test_contention_takes_from_the_speed_up() -> None:
    costs = msgspec.structs.replace(FREE_PARENT, contention=0.25)
    jobs = in_worlds(20, worlds=2, futures=10)
    one, two = (SweepModel(costs, workers=n, cores=2).play(jobs) for n in (1, 2))
    assert one.wall_s / two.wall_s == pytest.approx(2.0 / 1.25)


def test_each_worker_that_takes_part_in_a_world_pays_for_it_once() -> None:
    costs = msgspec.structs.replace(FREE_PARENT, first_s=1.0)
    jobs = in_worlds(8, worlds=2, futures=0)
    assert SweepModel(costs, workers=1, cores=2).play(jobs).wall_s == pytest.approx(2.0 + 0.8)
    assert SweepModel(costs, workers=2, cores=2).play(jobs).wall_s == pytest.approx(1.0 + 0.4)


def test_a_parent_that_is_slower_than_its_workers_sets_the_pace() -> None:
    costs = msgspec.structs.replace(FREE_PARENT, parent_job_s=0.05)
    jobs = in_worlds(600, worlds=1, futures=10)
    few = SweepModel(costs, workers=2, cores=2, local=False).play(jobs)
    many = SweepModel(costs, workers=32, cores=32, local=False).play(jobs)
    assert few.wall_s == pytest.approx(300 * 0.2, rel=0.01)
    # The state machine gives out before the parent works on rows: not all of 600 are waited for.
    assert 0.5 * 600 * 0.05 < many.wall_s < 1.1 * 600 * 0.05


def test_no_more_workers_have_work_than_tasks_are_held() -> None:
    jobs = in_worlds(64, worlds=1, futures=10)
    held = SweepModel(FREE_PARENT, workers=16, cores=16, ahead=4).play(jobs)
    assert held.wall_s == pytest.approx(16 * 0.2)
