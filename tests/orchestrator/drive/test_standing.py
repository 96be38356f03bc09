"""A conductor goes on where another one stood: nothing counted twice, nothing missing unsaid."""

from __future__ import annotations

import pickle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.drive import VehicleStatus
from foretwin.contracts.side_by_side import DrivenSegment
from foretwin.orchestrator.drive.live_loop import RoundGrid
from foretwin.orchestrator.drive.process_watch import ProcessWatch
from foretwin.orchestrator.drive.run_record import run_record
from foretwin.orchestrator.drive.standing import go_on, heard_of, read_standing, standing_of
from foretwin.orchestrator.record.ledger import jobs_ledger
from foretwin.orchestrator.runner.supervisor import Supervisor
from tests.orchestrator.drive.test_side_by_side_handler import plan_of
from tests.orchestrator.house import House
from tests.orchestrator.tuning.test_findings import ALARM, FOUND, VERDICT, gap

KILLED_AT = 40
GRID = RoundGrid(12.5, wanted=True)


def watch() -> ProcessWatch:
    def nobody(**_: Any) -> Any:
        raise AssertionError

    return ProcessWatch(Supervisor(nobody))


class Twice(SimpleNamespace):
    """A drive whose first orchestrator has left `left`, and the one that goes on with it."""

    first: House
    second: House


def killed(folder: Path, *, open_round: bool = True, crashed: bool = False) -> Twice:
    first = House(folder)
    first.drive(KILLED_AT, round_every=10)
    first.conductor.rounds.tally.due = first.conductor.rounds.tally.ended
    if open_round:
        first.conductor.rounds.tally.due += 1
        assert first.conductor.start_round()
    visits = first.mission.visits.take_news()
    first.tables.add("junctions", [visit.row(mono_s=0.0) for visit in visits])
    watched = watch()
    watched.troubles.append("w1 ended")
    watched.given_up.add("w1")
    first.conductor.rounds.siblings.count.dropped["late"] += 2
    first.conductor.rounds.futures.not_placed["behind the car"] += 2
    first.conductor.rounds.futures.failed["diverged"] += 3
    first.conductor.rounds.futures.remarked["the fallback acted"] += 4
    left = standing_of(first.conductor, watched, grid=GRID, heard=heard_of(first.conductor))
    first.tables.leave()
    second = House(folder, at_once=True, plan=first.plan)
    standing = read_standing(left)
    assert standing is not None
    other = watch()
    results = first.plan.folder / "results"
    go_on(second.conductor, other, standing, results, crashed=crashed)
    return Twice(first=first, second=second, watch=other, standing=standing)


@pytest.fixture
def twice(tmp_path: Path) -> Twice:
    return killed(tmp_path)


def test_nothing_is_handed_over_before_the_vehicle_has_said_what_it_is(tmp_path: Path) -> None:
    house = House(tmp_path, at_once=True)
    house.conductor.intake.info = None
    assert standing_of(house.conductor, watch(), grid=None, heard=b"") == b""
    assert read_standing(b"") is None
    house.tables.close()


def test_rounds_keep_their_numbers_and_the_open_one_is_cut_off(twice: Twice) -> None:
    first, second = twice.first.conductor.rounds, twice.second.conductor.rounds
    assert second.next_round_id == first.next_round_id
    assert second.futures.record(wanted=6, missed=0, spared=0, unseeded=0) == (
        first.futures.record(wanted=6, missed=0, spared=0, unseeded=0)
    )
    assert second.tally.run == first.futures.rounds >= 3
    assert (first.tally.cut_off, second.tally.cut_off) == (0, 1)
    jobs = jobs_ledger(second.dispatcher.dispatch.count)
    assert (jobs.balanced(), jobs.lost) == (True, 2)  # both of the open round
    twice.second.tables.close()


def test_the_drive_goes_on_and_leaves_one_run(twice: Twice) -> None:
    second = twice.second
    for number in range(KILLED_AT, KILLED_AT + 40):
        second.send(second.states[number])
        second.settle()
        if number % 10 == 0:
            second.conductor.rounds.tally.due += 1
            assert second.conductor.start_round()
    second._sent = KILLED_AT + 40
    second.end()
    folder = second.plan.folder / "results"
    rows = {name: pq.read_table(folder / f"{name}.parquet").to_pylist() for name in (
        "rounds", "futures", "metrics", "junctions"
    )}  # fmt: skip
    numbers = [row["round_id"] for row in rows["rounds"]]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] >= twice.first.conductor.rounds.next_round_id
    kinds = [row["name"] for row in rows["metrics"]]
    assert len(kinds) == len(set(kinds)) > 0
    rounds = second.conductor.rounds
    assert rounds.futures.rounds == rounds.tally.run == len(numbers)
    assert rounds.tally.ledger().due - rounds.tally.ended == twice.standing.rounds.tally.due - (
        twice.standing.rounds.tally.ended
    )


def test_the_state_goes_on_from_the_estimate_of_before(twice: Twice, tmp_path: Path) -> None:
    twice.second.send(twice.second.states[KILLED_AT])
    twice.second.settle()
    latest = twice.second.conductor.intake.latest
    assert latest is not None
    assert latest.state.yaw_valid
    assert latest.state.speed_mps > 1.0
    twice.second.tables.close()


def test_forecasts_go_on_from_what_was_learnt_before(twice: Twice) -> None:
    first, second = (house.conductor.rounds.progress for house in (twice.first, twice.second))
    assert first is not None
    assert second is not None
    assert second.history.now == first.history.now
    assert second.history.now is not None
    assert pickle.dumps(second.calibration) == pickle.dumps(first.calibration)
    told = twice.second.conductor.rounds.forecast_count.record()
    assert told == twice.first.conductor.rounds.forecast_count.record()
    assert told is not None
    assert told["count"] > 0
    twice.second.tables.close()


def test_after_an_error_of_ours_the_state_is_estimated_anew(tmp_path: Path) -> None:
    twice = killed(tmp_path, open_round=False, crashed=True)
    twice.second.send(twice.second.states[KILLED_AT])
    twice.second.settle()
    latest = twice.second.conductor.intake.latest
    assert latest is None or not latest.state.yaw_valid
    twice.second.tables.close()


def test_what_else_was_known_is_known_again(twice: Twice) -> None:
    second = twice.second.conductor
    assert twice.watch.troubles == ["w1 ended"]
    assert twice.watch.given_up == {"w1"}
    assert second.rounds.siblings.count.dropped == {"late": 2}
    futures = second.rounds.futures
    assert futures.not_placed["behind the car"] == 2
    assert (futures.failed, futures.remarked) == ({"diverged": 3}, {"the fallback acted": 4})
    assert twice.standing.grid == GRID
    assert second.intake.counts.received == twice.first.conductor.intake.counts.received > 0
    assert second.mission.way.place.s_m == twice.first.mission.way.place.s_m > 0.0
    record = run_record(second, 0, exit_word="completed", wall_s=1.0, mono_s=1.0,
                        ended_by=["signal 9"])  # fmt: skip
    assert record["orchestrator"] == {"restarts": 1, "ended_by": ["signal 9"]}
    twice.second.tables.close()


def test_changes_made_and_parameters_stay_in_force(tmp_path: Path) -> None:
    house = House(tmp_path)
    house.drive(20)
    parameters = house.conductor.tuning.parameters
    parameters.note([parameters.in_force.set("mass_kg", 1300.0, stamp_ns=1)])
    house.conductor.tuning.hand_over()
    house.conductor.roles.correction = "free"
    left = standing_of(house.conductor, watch(), grid=None, heard=heard_of(house.conductor))
    house.tables.leave()
    again = House(tmp_path, at_once=True, plan=house.plan)
    standing = read_standing(left)
    assert standing is not None
    results = house.plan.folder / "results"
    go_on(again.conductor, watch(), standing, results, crashed=False)
    counts = again.conductor.tuning.parameters
    assert (counts.version, counts.in_force.vehicle.mass_kg.value) == (1, 1300.0)
    assert counts.in_force.pinned == {"mass_kg"}
    assert [one.name for one in counts.made] == ["mass_kg"]
    assert counts.tell("w0")  # who comes up is told
    assert again.conductor.roles.correction == "free"
    again.tables.close()


def test_what_was_found_until_then_stays_found(tmp_path: Path) -> None:
    """Gap, verdicts, estimates, segments and windows: the record says what it said before."""
    house = House(tmp_path)
    status = VehicleStatus(stamp_ns=house.states[0].stamp_ns, control_mode="manual")
    house.bus.publish("status", status, vehicle="ego")
    house.bus.publish("plan", plan_of(house, 20, left_m=0.0), vehicle="ego")
    house.drive(120, round_every=10)
    findings = house.conductor.tuning.findings
    for found in (FOUND, gap(3.0), gap(4.0), gap(4.0, independent=False), ALARM, VERDICT):
        findings.take(found)
    segment = DrivenSegment(
        number=0, control_mode="manual", from_stamp_ns=1, to_stamp_ns=2, plans=3, ways=3, cut=0,
        too_short=0, lateral_m=0.1, along_m=0.1, speed_mps=0.1, disagreements=0,
    )  # fmt: skip
    house.conductor.ads.standing.ended.append(segment)
    house.conductor.mirror.independent = False
    house.conductor.mirror.compared, house.conductor.mirror.beyond = 7, 2
    house.tables.lost_before = 3
    before = findings.record(), house.conductor.ads.record()
    left = standing_of(house.conductor, watch(), grid=None, heard=heard_of(house.conductor))
    house.tables.leave()

    again = House(tmp_path, at_once=True, plan=house.plan)
    standing = read_standing(left)
    assert standing is not None
    results = house.plan.folder / "results"
    go_on(again.conductor, watch(), standing, results, crashed=False)
    assert (again.conductor.tuning.findings.record(), again.conductor.ads.record()) == before
    assert (before[0]["gap"]["samples"], before[0]["gap"]["without_commands"]) == (2, 1)
    assert before[1] is not None
    assert again.conductor.mirror.independent is False
    assert again.conductor.mirror.record() == {"samples": 7, "beyond_limits": 2}
    assert again.tables.dropped == 3
    # The windows are judged alike by who goes on, and by who would have gone on.
    record = [one.rounds.windows for one in (house.conductor, again.conductor)]
    start_ns = house.conductor.intake.start_stamp_ns
    mine, others = (windows.finish() and windows.record(start_ns) for windows in record)
    assert mine == others
    assert mine is not None
    assert mine["windows"] > 2  # type: ignore[index]
    again.tables.close()
