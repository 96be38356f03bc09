"""The car's own plan against the nominal future of the round that it comes with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import PlannedTrajectory
from foretwin.contracts.frames import geo_from_local, geo_from_local_yaw, local_from_geo
from foretwin.contracts.frames import local_from_geo_yaw as to_local_yaw
from foretwin.orchestrator.rounds.comparisons import plan_compared
from foretwin.orchestrator.rounds.jobs import PLAN_FRESH_NS
from tests.orchestrator.futures_rounds import round_done, straight
from tests.orchestrator.house import House
from tests.orchestrator.trip import town, town_world


@pytest.fixture
def now_ns(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The clock, which stands still: what comes late is not told."""
    found = [10**9]
    monkeypatch.setattr("time.monotonic_ns", lambda: found[0])
    return found


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def car_plan(house: House, number: int, *, left_m: float) -> PlannedTrajectory:
    """A plan at the car's speed straight on, shifted to the left."""
    frame, state = town().graph.frame, house.states[number]
    position = state.position
    xy = local_from_geo(frame, position.lat_deg, position.lon_deg)
    yaw = float(to_local_yaw(frame, state.yaw_rad, position.lat_deg, position.lon_deg))
    time_s = np.linspace(0.0, 4.0, 21)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    points = xy + 10.0 * time_s[:, None] * ahead + left_m * left
    geo = geo_from_local(frame, points)
    return PlannedTrajectory(
        stamp_ns=state.stamp_ns, time_from_stamp_s=time_s, lat_deg=geo[:, 0].copy(),
        lon_deg=geo[:, 1].copy(), yaw_rad=geo_from_local_yaw(frame, np.full(21, yaw), points),
        speed_mps=np.full(21, 10.0),
    )  # fmt: skip


@pytest.mark.usefixtures("now_ns")
def test_a_plan_shifted_by_a_metre_is_a_metre_off(house: House) -> None:
    house.drive(49)
    house.bus.publish("plan", car_plan(house, 49, left_m=1.0), vehicle="ego")
    house.drive(50)
    assert house.conductor.start_round()
    house.work()

    (compared,) = house.watched("plan_comparison")
    assert compared.difference.lateral_m == pytest.approx(1.0, abs=0.1)
    assert compared.difference.ade_m == pytest.approx(1.0, abs=0.1)
    assert house.conductor.rounds.plans.record()["count"] == 1


@pytest.mark.parametrize(("older_s", "counts"), [(0.0, True), (0.9, True), (1.1, False)])
def test_a_plan_that_is_a_second_old_is_neither_compared_nor_followed(
    house: House, older_s: float, counts: bool
) -> None:
    assert PLAN_FRESH_NS == 10**9
    house.drive(49)
    plan = car_plan(house, 49, left_m=1.0)
    age_ns = round(older_s * 1e9)
    house.bus.publish(
        "plan", msgspec.structs.replace(plan, stamp_ns=plan.stamp_ns - age_ns), vehicle="ego"
    )
    house.drive(50)
    assert house.conductor.start_round()
    house.settle()
    asked = [one for worker in house.workers for one in worker.take()]
    jobs = [one.message().decoded() for one in asked]
    state = house.states[49]
    assert len(jobs) >= 2
    for job in jobs:
        assert (job.car_plan is not None) == counts
        if job.car_plan is not None:
            apart_s = job.state.stamp_ns / 1e9 - state.stamp_ns / 1e9 + older_s
            assert job.car_plan.time_s == pytest.approx(plan.time_from_stamp_s - apart_s, abs=1e-6)
            assert job.car_plan.speed_mps.tolist() == plan.speed_mps.tolist()
    for one in asked:
        house.workers[0].answer_one(one)
    house.settle()
    assert (house.watched("plan_comparison") != []) == counts


def test_a_nominal_future_that_diverged_is_compared_with_nothing(house: House) -> None:
    house.workers[0].diverges = house.workers[1].diverges = True
    house.drive(49)
    house.bus.publish("plan", car_plan(house, 49, left_m=1.0), vehicle="ego")
    house.drive(50)
    assert house.conductor.start_round()
    house.work()
    house.drive(160)
    house.end()

    assert house.conductor.rounds.futures.count == 6
    assert house.conductor.rounds.plans.record() is None
    assert house.conductor.rounds.comparisons.record(independent=True)["ade_m"] == {}


def test_what_a_late_round_says_of_a_plan_is_recorded_and_not_told(
    now_ns: list[int], house: House
) -> None:
    house.drive(49)
    house.bus.publish("plan", car_plan(house, 49, left_m=1.0), vehicle="ego")
    house.drive(50)
    assert house.conductor.start_round()
    now_ns[0] += 10**10
    house.work()

    assert house.watched("plan_comparison") == []
    assert house.conductor.rounds.plans.record()["count"] == 1


def test_an_old_plan_of_the_car_is_not_compared(house: House) -> None:
    house.bus.publish("plan", car_plan(house, 0, left_m=1.0), vehicle="ego")
    house.drive(30)
    assert house.conductor.start_round()
    house.work()

    assert house.conductor.rounds.plans.record() is None


def test_without_a_plan_there_is_nothing_to_compare(house: House) -> None:
    done, world = round_done(straight()), town_world("n4")
    path = done.order.jobs[0].path
    assert plan_compared(done, None, house.states[0], path, world) is None


def test_a_plan_without_points_is_none(house: House) -> None:
    """Autoware sends such where it has no route; nothing may be followed or compared, nor fail."""
    house.drive(49)
    some = car_plan(house, 49, left_m=1.0)
    none = np.zeros(0)
    empty = PlannedTrajectory(
        stamp_ns=some.stamp_ns + 1, time_from_stamp_s=none, lat_deg=none, lon_deg=none,
        yaw_rad=none, speed_mps=none,
    )  # fmt: skip
    for plan in (some, empty):
        house.bus.publish("plan", plan, vehicle="ego")
    house.drive(50)
    assert house.conductor.start_round()
    house.work()

    assert house.conductor.rounds.tally.run == 1
    assert house.conductor.rounds.plans.record() is None
