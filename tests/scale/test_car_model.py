"""Rounds of cars on shared seats, where the outcome can be told by hand."""

from __future__ import annotations

import msgspec
import pytest

from tests.scale.car_model import PERIOD_S, CarCosts, CarsModel, Cluster

COSTS = CarCosts(
    job_cpu_s=(0.2,), start_s=0.01, end_s=0.02, world_s=0.0, question_bytes=0.0, answer_bytes=0.0,
    contention=0.0,
)  # fmt: skip


def test_a_car_alone_waits_for_nobody() -> None:
    rounds = CarsModel(COSTS, 1, Cluster(seats=2, cores=2)).drive(20.0)
    assert rounds.taken_s == pytest.approx(0.01 + 0.1 + 0.02)
    assert len(rounds.taken_s) == pytest.approx(15.0 / PERIOD_S, abs=1)
    assert (rounds.missed, rounds.late_share) == (0, 0.0)
    assert rounds.core_use == pytest.approx(0.2 / PERIOD_S / 2, rel=0.05)


def test_on_one_seat_its_jobs_come_after_each_other() -> None:
    rounds = CarsModel(COSTS, 1, Cluster(seats=1, cores=1)).drive(20.0)
    assert rounds.taken_s == pytest.approx(0.01 + 0.2 + 0.02)


def test_neighbours_slow_each_other() -> None:
    costs = msgspec.structs.replace(COSTS, contention=0.5)
    rounds = CarsModel(costs, 1, Cluster(seats=2, cores=2)).drive(20.0)
    assert rounds.taken_s == pytest.approx(0.01 + 0.15 + 0.02)


def test_bytes_and_distance_take_time() -> None:
    costs = msgspec.structs.replace(COSTS, question_bytes=1e4, answer_bytes=1e5)
    cluster = Cluster(seats=2, cores=2, bytes_per_s=1e7, away_s=0.05)
    rounds = CarsModel(costs, 1, cluster).drive(20.0)
    # Of two questions and two answers, each waits for those before it.
    assert rounds.taken_s == pytest.approx(0.03 + 2 * 0.05 + 0.1 + 0.001 + 0.02, abs=1e-6)
    assert rounds.link_use == pytest.approx(2 * 1.1e5 / 1e7 / PERIOD_S, rel=0.05)


def test_a_seat_compiles_a_world_it_does_not_hold() -> None:
    costs = msgspec.structs.replace(COSTS, world_s=0.1)
    rounds = CarsModel(costs, 1, Cluster(seats=2, cores=2)).drive(46.0, settled_s=0.0)
    slow = int((rounds.taken_s > 0.2).sum())
    assert slow == 3  # at 0, 20 and 40 s


def test_too_few_seats_miss_rounds_and_enough_miss_none() -> None:
    few = CarsModel(COSTS, 20, Cluster(seats=6, cores=6)).drive(30.0)
    enough = CarsModel(COSTS, 20, Cluster(seats=12, cores=12)).drive(30.0)
    assert few.late_share > 0.2
    assert few.core_use > 0.97
    assert enough.late_share == 0.0
