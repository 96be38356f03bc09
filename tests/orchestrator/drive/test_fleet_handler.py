"""Workers of other machines enlist, are measured and tried, and play along; or say why not."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.bus import Mailbox, Request
from foretwin.contracts.fleet import (
    WorldQuestion,
)
from foretwin.contracts.futures import FuturesResult
from foretwin.contracts.runner import JobAnswer
from foretwin.contracts.tuning import SetRequest
from foretwin.contracts.world_identity import checked_world
from foretwin.orchestrator.drive import fleet_handler
from foretwin.orchestrator.drive.progress import ProgressLine
from foretwin.orchestrator.record.machine import this_machine
from tests.orchestrator.drive.far_away import FAR, FarAway, settle
from tests.orchestrator.house import House, Worker

COVERS = (
    "foretwin.orchestrator.drive.active_world",
    "foretwin.orchestrator.drive.far_member",
    "foretwin.orchestrator.drive.reference_probe",
)
CLOSED = {"endpoint": None, "insecure": False}


def member(house: House) -> dict[str, Any]:
    (row,) = house.conductor.fleet.record()
    return row


@pytest.fixture
def house(tmp_path: Path) -> House:
    made = House(tmp_path, speed=1.0, workers=1, futures_per_job=3)
    made.drive(20)
    return made


def events(house: House) -> list[str]:
    return [one.text for one in house.watched("event")]


def test_who_comes_to_our_bits_plays_along(house: House) -> None:
    far = FarAway(house)
    settle(house, far)
    assert member(house)["stage"] == "playing"
    assert far.admitted == [""]
    assert FAR in house.conductor.rounds.dispatcher.workers
    (said,) = far.enlisted
    assert (said.vehicle, said.simulations) == (house.plan.vehicle, 3)
    assert any(text.startswith(f"{FAR} plays along: ") for text in events(house))
    jobs = far.jobs
    assert house.conductor.start_round()
    settle(house, far)
    assert far.jobs == jobs + 1  # one of the round's two
    assert house.conductor.rounds.tally.run == 1


def test_its_worlds_are_given_by_their_hash(house: House) -> None:
    world_id = next(iter(house.workers[0].prepared))
    asked = Mailbox(1)
    request = WorldQuestion(world_id=world_id)
    house.bus.request("world_file", request, asked, run=house.plan.run_id)
    house.settle()
    reply = asked.take()
    assert checked_world(reply.message.data, world_id, where="bus").id == world_id  # type: ignore[union-attr]
    house.bus.request("world_file", WorldQuestion(world_id="none"), asked, run=house.plan.run_id)
    house.settle()
    assert asked.take().error == "World none: No such file or directory"  # type: ignore[union-attr]


@pytest.mark.parametrize("world_id", ["../../etc/passwd", "/etc/passwd", "", "*"])
def test_who_asks_for_what_is_no_world_is_told_so(house: House, world_id: str) -> None:
    asked, question = Mailbox(1), WorldQuestion(world_id=world_id)
    for _ in range(2):
        house.bus.request("world_file", question, asked, run=house.plan.run_id)
        house.settle()
        assert "world_file: WorldQuestion: world_id" in asked.take().error  # type: ignore[union-attr]
    assert sum(text.startswith("refused: ") for text in events(house)) == 1


def test_rubbish_of_one_that_plays_is_counted_and_told_as_its_sickness(house: House) -> None:
    far = FarAway(house)
    settle(house, far)
    assert house.conductor.start_round()
    for request in far.take():
        request._answer(b"\xc1 rubbish", "")
    settle(house, far)
    told = [text for text in events(house) if f"{FAR}" in text and "plays" not in text]
    assert house.conductor.rounds.tally.run == 1
    assert house.conductor.refusals.record()["refused"]["count"] == 1
    (line,) = told
    assert line.startswith(f"{FAR} is sick, it refuses jobs: ")


def other_bits(result: FuturesResult) -> FuturesResult:
    result.trajectory.states[-1, -1, 0] += 1e-3
    return result


def test_who_comes_to_other_bits_is_refused_with_both_named(house: House) -> None:
    far = FarAway(house, versions={**this_machine().versions, "numpy": "1.0"})
    far.spoil = other_bits
    settle(house, far)
    row = member(house)
    assert row["stage"] == "refused"
    here = this_machine().versions["numpy"]
    assert row["refused"] == (
        f"laptop plays other bits than this machine: numpy 1.0 there, {here} here"
    )
    assert far.admitted == [row["refused"]]
    assert house.conductor.rounds.dispatcher.workers == ("w0",)
    assert f"{row['refused']}; it gets no work" in events(house)


def test_other_arithmetic_is_refused_though_a_probe_might_not_show_it(house: House) -> None:
    here = this_machine()
    far = FarAway(house, cpu="Old", arithmetic={**here.arithmetic, "arctan2 float64": "x"})
    settle(house, far)
    assert far.jobs == 0
    assert far.admitted == [
        "laptop computes other bits than this machine (arctan2 float64): "
        f"Old there, {here.cpu} here"
    ]


def test_another_version_of_the_program_is_refused_before_anything_is_played(house: House) -> None:
    far = FarAway(house, versions={**this_machine().versions, "foretwin": "0.0.1"})
    settle(house, far)
    assert far.jobs == 0
    assert far.admitted[0].startswith("laptop runs foretwin 0.0.1, this drive ")


@pytest.mark.parametrize("off_s", [-0.8, 30.0])
def test_a_clock_that_is_far_off_is_refused_with_by_how_much(house: House, off_s: float) -> None:
    far = FarAway(house)
    far.clock_off_s = off_s
    settle(house, far)
    assert far.jobs == 0
    said = re.match(r"the clock of laptop is ([-+]\d+\.\d+) s off", far.admitted[0])
    assert said is not None
    assert float(said[1]) == pytest.approx(off_s, abs=0.05)
    assert member(house)["clock_offset_ms"] == pytest.approx(1e3 * off_s, abs=50.0)


def test_a_clock_that_is_set_while_it_plays_is_noticed(house: House) -> None:
    far = FarAway(house)
    settle(house, far)
    far.clock_off_s = 5.0
    settle(house, far, rounds=30)
    assert member(house)["stage"] == "refused"
    assert house.conductor.rounds.dispatcher.workers == ("w0",)


def test_one_that_is_gone_is_no_loss_and_needs_no_probe_when_it_is_back(house: House) -> None:
    far = FarAway(house)
    settle(house, far)
    assert house.conductor.start_round()
    far.die()
    house.settle()
    house.work()
    assert house.conductor.rounds.tally.run == 1
    assert member(house)["stage"] == "gone"
    back = FarAway(house)
    settle(house, back, rounds=1)
    assert member(house)["stage"] == "playing"
    assert back.jobs == 0


def test_another_life_of_it_is_tried_anew(house: House) -> None:
    far = FarAway(house)
    settle(house, far)
    far.die()
    house.settle()
    back = FarAway(house)
    back.instance = "another"
    settle(house, back)
    assert back.jobs == fleet_handler.PROBES


def test_one_that_takes_no_more_finishes_and_is_given_nothing(house: House) -> None:
    far = FarAway(house)
    settle(house, far)
    far_reply = Worker.answer_one

    def leaving(request: Request) -> None:
        answer = request.reply
        request.reply = lambda message: answer(  # type: ignore[method-assign]
            msgspec.structs.replace(message, leaving=True)
            if isinstance(message, JobAnswer)
            else message
        )
        far_reply(far, request)

    assert house.conductor.start_round()
    for request in far.take():
        leaving(request)
    house.settle()
    house.work()
    assert house.conductor.rounds.tally.run == 1
    assert house.conductor.rounds.dispatcher.workers == ("w0",)
    jobs = far.jobs
    assert house.conductor.start_round()
    settle(house, far, rounds=2)
    assert (far.jobs, house.conductor.rounds.tally.run) == (jobs, 2)


def test_no_world_waits_for_a_far_worker(tmp_path: Path) -> None:
    house = House(tmp_path, speed=1.0, workers=1)
    house.drive(1)
    far = FarAway(house)
    settle(house, far)
    known = list(house.workers[0].prepared)
    assert set(far.prepared) == set(known)
    house.drive(30)
    (new,) = house.workers[0].prepared[len(known) :]
    assert new not in far.prepared  # it was asked, and has not answered yet
    assert house.conductor.worlds.building == []
    far.answer()
    assert new in far.prepared


def test_changed_parameters_reach_it_before_it_gets_another_job(house: House) -> None:
    far = FarAway(house)
    settle(house, far)
    answers = Mailbox(1)
    request = SetRequest(key="vehicle.mass_kg", value="1500")
    house.bus.request("set", request, answers, run=house.plan.run_id)
    house.settle()
    house.conductor.make_changes()
    assert house.conductor.rounds.dispatcher.workers == ("w0",)
    settle(house, far)
    assert far.enlisted[-1].vehicle.mass_kg.value == 1500.0
    assert far.enlisted[-1].version == 1
    assert FAR in house.conductor.rounds.dispatcher.workers


@pytest.mark.parametrize(
    "settings", [{"speed": 1.0, **CLOSED}, {"speed": None}], ids=["one host", "lock step"]
)
def test_elsewhere_it_is_a_stranger(tmp_path: Path, settings: dict[str, Any]) -> None:
    house = House(tmp_path, workers=1, **settings)
    FarAway(house)
    house.settle()
    assert house.conductor.fleet.record() == []
    assert house.conductor.strangers.count == 1


def test_more_than_so_many_are_strangers(house: House) -> None:
    for number in range(fleet_handler.MOST_MEMBERS + 2):
        house.bus.declare_alive(f"foretwin/v1/run/{house.plan.run_id}/alive/w-x-{number}")
    house.settle()
    assert len(house.conductor.fleet.record()) == fleet_handler.MOST_MEMBERS
    assert house.conductor.strangers.count == 2


def test_who_is_there_is_told_on_the_line_and_to_the_viewer(
    house: House, capsys: pytest.CaptureFixture[str]
) -> None:
    far, seen = FarAway(house), Mailbox(64)
    settle(house, far)
    house.bus.subscribe("worker_status", seen, run=house.plan.run_id)
    with ProgressLine(house.conductor, house.mission) as line:
        line.update(line._last_plain_s + 20.0)
    assert "workers 1/1 +1 far  " in capsys.readouterr().err
    near_status, far_status = (seen.take().message() for _ in range(2))  # type: ignore[union-attr]
    assert (near_status.worker_id, near_status.link_ms) == ("w0", None)
    assert (far_status.worker_id, far_status.state) == (FAR, "idle")
    assert 0.0 <= far_status.link_ms < 1e3
    assert abs(far_status.clock_offset_ms) < 500.0


def test_one_that_does_not_tell_the_time_gets_nothing_until_it_does(house: House) -> None:
    far = FarAway(house)
    settle(house, far)
    playing = house.conductor.rounds.dispatcher.dispatch.far
    house.conductor.fleet.look(time.monotonic() + 100.0)
    for box in far._boxes:
        while box.take() is not None:
            pass  # forgotten: nobody answers
    house.settle()
    assert playing.is_silent(FAR)
    assert house.conductor.start_round()
    house.work()
    assert (house.conductor.rounds.tally.run, far.take()) == (1, [])
    settle(house, far, rounds=130)
    assert not playing.is_silent(FAR)
