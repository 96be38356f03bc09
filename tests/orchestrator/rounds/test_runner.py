"""Rounds differ by their state alone, fit the machine, and say what became of them."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.simulation import Event
from foretwin.orchestrator.record import run_folder
from foretwin.orchestrator.record.run_streams import NAMED, Rows
from foretwin.orchestrator.rounds.pace import Pace
from tests.orchestrator.house import House


def test_parameters_that_a_full_disk_does_not_take_are_written_with_the_next_round(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError("No space left on device")

    house = House(tmp_path)
    house.drive(20)
    rounds = house.conductor.rounds
    other = msgspec.structs.replace(house.plan.vehicle, mass_kg=1234.0)
    vehicles = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.vehicle")}
    assert len(vehicles) == 1
    with monkeypatch.context() as patched:
        patched.setattr(run_folder, "keep_vehicles", full)
        rounds.use_vehicle(other, 1)
        assert house.conductor.start_round()
    house.workers[0].answer()
    house.work()
    house.drive(40)
    assert house.conductor.start_round()
    rounds.use_vehicle(house.plan.vehicle, 2)
    house.tables.close()
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.vehicle")}
    assert len(kept) == 2
    assert vehicles.items() <= kept.items(), "what is there stays"


def test_rounds_differ_by_their_state_and_not_by_their_variants(tmp_path: Path) -> None:
    house = House(tmp_path)
    seen = []
    for until in (20, 40):
        house.drive(until)
        assert house.conductor.start_round()
        seen.append(house.workers[0].take()[0])
        house.workers[0].answer_one(seen[-1])
        house.work()
    house.tables.close()
    early, late = (request.message().decoded() for request in seen)

    assert early.futures == late.futures
    assert late.state.stamp_ns - early.state.stamp_ns == 2_000_000_000
    assert (early.round_id, late.round_id) == (0, 1)
    moved = late.path.xy_m[0] - early.path.xy_m[0]
    assert np.hypot(*moved) == pytest.approx(20.0, abs=2.0)


def test_what_a_row_names_is_handed_over_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    house, order = House(tmp_path), list[str]()
    add = house.tables.add

    def noted(table: str, rows: Rows) -> None:
        order.append(table)
        add(table, rows)

    monkeypatch.setattr(house.tables, "add", noted)
    house.drive(20)
    assert house.conductor.start_round()
    house.workers[0].answer_one(house.workers[0].take()[0])
    house.work()
    house.tables.close()
    about = [table for table in order if table in NAMED or table == "jobs"]
    assert about == ["jobs", "road_users", "jobs", "road_users", "futures", "rounds"]


def test_speed_of_simulation_is_known_of_each_worker(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    assert house.conductor.start_round()
    house.work()
    house.tables.close()

    assert house.conductor.rounds.rtf == {"w0": pytest.approx(80.0), "w1": pytest.approx(80.0)}


def test_late_rounds_make_the_next_ones_smaller_and_say_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = [10**9]
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns[0])
    house = House(tmp_path, futures=64, futures_per_job=32, least_futures=16, rate_hz=2.0)
    house.drive(20)
    told: list[Event] = []
    house.conductor.events.on_event = told.append
    sizes = []
    cold = 3.0  # the workers meet the World
    for seconds in (cold, 0.1, 0.7, 0.7, 0.55, 0.55):
        assert house.conductor.start_round()
        now_ns[0] += round(seconds * 1e9)
        house.work()
        (view,) = house.watched("round")
        sizes.append(len(view.names))
    house.end()

    assert sizes == [64, 64, 64, 64, 32, 32]
    assert [(event.level, event.text) for event in told] == [
        (
            "warning",
            "32 of 64 futures from now on: the machine is too slow for all at 2 Hz",
        ),
        ("info", "16 of 64 futures from now on: the machine is too slow for all at 2 Hz"),
    ]
    record = house.conductor.rounds.futures.record(wanted=64, missed=0, spared=0, unseeded=0)
    assert (record["smaller_rounds"], record["rounds_by_futures"]) == (2, {"32": 2, "64": 4})


@pytest.mark.parametrize(
    ("seconds", "one_of", "late"), [(0.4, 1, False), (0.6, 1, True), (0.9, 2, False)]
)
def test_a_round_that_is_complete_after_its_deadline_is_told_as_late(
    seconds: float, one_of: int, late: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = [10**9]
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns[0])
    house = House(tmp_path, rate_hz=2.0)
    house.drive(20)
    house.conductor.rounds.pace.now = Pace(6, one_of)
    assert house.conductor.start_round()
    now_ns[0] += round(seconds * 1e9)
    house.work()
    (view,) = house.watched("round")
    house.end()

    assert view.late is late
    assert house.conductor.rounds.futures.late_rounds == int(late)
    (row,) = pq.read_table(house.plan.folder / "results" / "rounds.parquet").to_pylist()
    assert row["late"] is late


def test_when_the_machine_keeps_up_again_that_is_said_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = [10**9]
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns[0])
    house = House(tmp_path, futures=8, futures_per_job=4, least_futures=4, rate_hz=2.0)
    house.drive(20)
    told: list[Event] = []
    house.conductor.events.on_event = told.append
    for seconds in (3.0, 9.0, 9.0, *[0.01] * 90):
        assert house.conductor.start_round()
        now_ns[0] += round(seconds * 1e9)
        house.work()
    house.end()

    assert [(event.level, event.text.split(" futures")[0]) for event in told[:2]] == [
        ("warning", "4 of 8"), ("info", "4 of 8"),
    ]  # fmt: skip
    assert told[0].text.startswith("4 of 8 futures in 1 of 4 rounds from now on: ")
    assert (told[-1].level, told[-1].text) == (
        "info", "the machine keeps up: all futures in every round again",
    )  # fmt: skip
    assert house.conductor.rounds.pace.short_of == ""


def test_after_its_longest_horizon_a_round_is_compared(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    assert house.conductor.start_round()
    house.work()
    house.drive(95)
    assert house.watched("comparison") == []
    house.drive(105)
    assert {one.horizon_s for one in house.watched("comparison")} == {1.0, 2.0, 4.0, 8.0}
    house.end()
    assert house.watched("comparison") == [], "each once"


def test_at_the_drives_end_what_it_has_covered_is_compared(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    assert house.conductor.start_round()
    house.work()
    house.drive(65)
    house.end()

    assert {one.horizon_s for one in house.watched("comparison")} == {1.0, 2.0, 4.0}
    rows = pq.read_table(house.plan.folder / "results" / "comparisons.parquet").to_pylist()
    assert {row["horizon_s"] for row in rows} == {1.0, 2.0, 4.0}


def test_in_lock_step_late_rounds_change_nothing(tmp_path: Path) -> None:
    house = House(tmp_path, speed=None, rate_hz=50.0, least_futures=1)
    house.drive(40, round_every=1)
    house.end()

    assert house.conductor.rounds.futures.rounds_of.keys() == {6}
    assert house.conductor.rounds.futures.late_rounds == 0


def test_who_acts_for_a_planner_is_said_once_for_each(tmp_path: Path) -> None:
    house = House(tmp_path, planner="remote", futures=16, futures_per_job=8)
    house.drive(20)
    told: list[Event] = []
    house.conductor.events.on_event = told.append
    for worker in house.workers:
        worker.remark = "fallback 'pure_pursuit_idm' acted from 0 s on: no answer within 1 s"
    for _ in range(3):
        assert house.conductor.start_round()
        house.work()
    house.end()

    assert [(event.level, event.text[:40]) for event in told] == [
        ("warning", "a future driven by remote: fallback 'pur"),
        ("warning", "a future driven by constant_speed: fallb"),
    ]


def test_a_way_on_the_lanes_is_not_counted_as_off_them(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    assert house.conductor.start_round()
    house.work()
    house.end()
    assert house.conductor.rounds.futures.off_lanes_rounds == 0


def test_forecasts_are_held_against_how_far_the_car_got(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    assert house.conductor.start_round()
    house.work()
    house.drive(60)
    house.end()
    rows = pq.read_table(house.plan.folder / "results" / "forecasts.parquet").to_pylist()
    assert {row["round_id"] for row in rows} == {0}
    assert len(rows) == house.conductor.rounds.forecast_count.rows.count


def test_a_round_that_is_open_at_the_drives_end_is_cut_off(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    assert house.conductor.start_round()
    rounds = house.conductor.rounds
    rounds.close()
    house.tables.close()
    assert not rounds.open
    assert (rounds.tally.cut_off, rounds.tally.run, rounds.tally.failed) == (1, 0, 0)


def test_a_worker_that_nobody_started_here_is_counted_with(tmp_path: Path) -> None:
    """One round waits for it: both of ours refuse."""
    house = House(tmp_path)
    house.drive(20)
    rounds = house.conductor.rounds
    rounds.enroll("w-far-0")
    assert house.conductor.start_round()
    while asked := [one for worker in house.workers for one in worker.take()]:
        for one in asked:
            one.refuse("no disk")
        house.settle()
    assert rounds.open
    rounds.never_again("w-far-0")
    house.tables.close()
    assert not rounds.open
    assert rounds.tally.failed == 1
