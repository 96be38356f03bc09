"""Parameters on their way: set by hand or identified, handed over between rounds, named by jobs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.futures import Job
from foretwin.contracts.keys import alive_key
from foretwin.contracts.mailbox import Mailbox, Reply, Request
from foretwin.contracts.runner import JobRequest
from foretwin.contracts.tuning import (
    Identification,
    ParameterEstimate,
    SetReply,
    SetRequest,
    TuneReply,
    TuneRequest,
    UseVehicle,
)
from tests.orchestrator.house import House, Worker

FOUND = Identification(
    vehicle_id="ego", from_stamp_ns=0, stamp_ns=8,
    estimates=(ParameterEstimate(name="steering_ratio", value=15.3, low=15.1, high=15.5),),
)  # fmt: skip


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path, tuning="report")
    yield made
    made.tables.close()


def asked(house: House, process_id: str, channel: str = "use_vehicle") -> Mailbox:
    """Where a process gets its questions of one channel."""
    mailbox = Mailbox(8)
    house.bus.serve(channel, mailbox, run=house.plan.run_id, process=process_id)
    return mailbox


def set_mass(house: House) -> Mailbox:
    answers = Mailbox(1)
    house.bus.request(
        "set", SetRequest(key="vehicle.mass_kg", value="1300"), answers, run=house.plan.run_id
    )
    house.settle()
    return answers


def answer(questions: Mailbox) -> Any:
    """Answer the one question that was asked; returns it."""
    question = questions.take()
    assert isinstance(question, Request)
    message = question.message()
    question.reply(message)
    assert questions.take() is None
    return message


def jobs(house: House) -> list[Job]:
    """What the workers are at."""
    busy = house.conductor.rounds.dispatcher.dispatch.busy
    return [
        request.decoded()
        for task in busy.values()
        if isinstance(request := task.question, JobRequest)
    ]


def test_no_round_starts_before_every_worker_has_what_was_set(house: House) -> None:
    questions = [asked(house, worker.process_id) for worker in house.workers]
    house.drive(20)
    assert house.conductor.start_round()
    assert {job.vehicle_version for job in jobs(house)} == {0}
    answers = set_mass(house)
    house.conductor.make_changes()
    assert answers.take() is None, "a round is open"
    house.work()
    house.conductor.make_changes()
    reply = answers.take()
    assert isinstance(reply, Reply)
    assert reply.message == SetReply(
        done=True,
        text=f"vehicle.mass_kg: 1093.3 -> 1300, pinned, from {now_s(house):.2f} s of the drive on",
    )
    parameters = house.conductor.tuning.parameters
    assert not parameters.settled
    for mailbox in questions:
        use: UseVehicle = answer(mailbox)
        assert (use.version, use.vehicle.mass_kg.value) == (1, 1300.0)
        assert use.stamp_ns == house.states[19].stamp_ns + 1
    house.settle()
    assert parameters.settled
    assert house.conductor.start_round()
    assert {job.vehicle_version for job in jobs(house)} == {1}
    assert house.conductor.tuning.record()["version"] == 1


def now_s(house: House) -> float:
    return (house.conductor.intake.now_stamp_ns + 1 - house.conductor.intake.start_stamp_ns) / 1e9


def test_a_worker_that_comes_up_gets_no_job_before_it_has_what_counts(house: House) -> None:
    first = asked(house, "w0")
    house.drive(20)
    house.workers[-1].die()
    set_mass(house)
    house.conductor.make_changes()
    answer(first)
    late = asked(house, "w1")
    worker = Worker(house.plan, house.bus, "w1")
    house.settle()
    assert "w1" not in house.conductor.rounds.dispatcher.workers
    assert answer(late).version == 1
    house.settle()
    assert "w1" in house.conductor.rounds.dispatcher.workers
    worker.die()


def test_a_process_that_dies_holds_up_nothing(house: House) -> None:
    house.bus.declare_alive(alive_key(run=house.plan.run_id, process="tuning"))
    watcher = asked(house, "tuning")
    house.drive(20)
    for worker in house.workers:
        asked(house, worker.process_id)
    set_mass(house)
    house.conductor.make_changes()
    for process_id in ("tuning", *(worker.process_id for worker in house.workers)):
        assert not house.conductor.tuning.parameters.settled
        house.bus.lose(alive_key(run=house.plan.run_id, process=process_id))
        house.settle()
    assert house.conductor.tuning.parameters.settled
    assert len(watcher) == 1


def test_in_lock_step_rounds_wait_for_the_watcher_too(tmp_path: Path) -> None:
    house = House(tmp_path, tuning="report", speed=None)
    house.bus.declare_alive(alive_key(run=house.plan.run_id, process="tuning"))
    questions = [asked(house, name) for name in ("tuning", *(w.process_id for w in house.workers))]
    house.drive(20)
    set_mass(house)
    house.conductor.make_changes()
    for mailbox in questions[1:]:
        answer(mailbox)
    house.settle()
    assert not house.conductor.tuning.parameters.settled
    answer(questions[0])
    house.settle()
    assert house.conductor.tuning.parameters.settled
    house.tables.close()


def test_a_watcher_that_is_started_again_is_told_what_counts(house: House) -> None:
    alive = alive_key(run=house.plan.run_id, process="tuning")
    house.bus.declare_alive(alive)
    watcher = asked(house, "tuning")
    house.drive(20)
    set_mass(house)
    house.conductor.make_changes()
    assert answer(watcher).version == 1
    house.bus.lose(alive)
    house.settle()
    house.bus.declare_alive(alive)
    house.settle()
    again: UseVehicle = answer(watcher)
    assert (again.version, again.vehicle.mass_kg.value) == (1, 1300.0)
    assert [(one.name, one.origin) for one in again.changes] == [("mass_kg", "set")]
    assert again.pinned == ("mass_kg",)


def test_live_no_round_waits_for_who_only_watches(house: House) -> None:
    house.bus.declare_alive(alive_key(run=house.plan.run_id, process="tuning"))
    watcher = asked(house, "tuning")
    workers = [asked(house, worker.process_id) for worker in house.workers]
    house.drive(20)
    set_mass(house)
    house.conductor.make_changes()
    for questions in workers:
        answer(questions)
    house.settle()
    assert house.conductor.tuning.parameters.settled
    assert len(watcher) == 1
    assert house.conductor.start_round()


@pytest.mark.parametrize(("mode", "version"), [("report", 0), ("apply", 1)])
def test_what_is_identified_counts_only_where_it_shall(
    tmp_path: Path, mode: str, version: int
) -> None:
    house = House(tmp_path, tuning=mode)
    for worker in house.workers:
        asked(house, worker.process_id)
    house.drive(5)
    house.bus.publish("identification", FOUND, run=house.plan.run_id)
    house.settle()
    house.conductor.make_changes()
    assert house.conductor.tuning.parameters.version == version
    said = [event.text for event in house.watched("event") if "steering_ratio" in event.text]
    assert len(said) == 1
    record = house.conductor.tuning.record()
    assert record["mode"] == mode
    house.tables.close()


def test_in_lock_step_findings_count_when_they_are_taken(tmp_path: Path) -> None:
    house = House(tmp_path, tuning="apply", speed=None)
    house.bus.declare_alive(alive_key(run=house.plan.run_id, process="tuning"))
    questions = asked(house, "tuning", "tune")
    house.drive(5)
    tuning = house.conductor.tuning
    tuning.weigh({"gnss": 5})
    question = questions.take()
    assert isinstance(question, Request)
    assert question.message() == TuneRequest(
        published={"gnss": 5}, states=house.conductor.intake.states
    )
    assert tuning.weighing
    question.reply(TuneReply(identifications=(FOUND,)))
    house.settle()
    assert not tuning.weighing
    assert not tuning.parameters.waiting
    tuning.take_weighed()
    assert tuning.parameters.waiting
    tuning.weigh({"gnss": 5})
    question = questions.take()
    assert isinstance(question, Request)
    question.refuse("out of words")
    house.settle()
    assert not tuning.weighing
    assert "tuning: out of words" in [event.text for event in house.watched("event")]
    house.tables.close()


def test_tyres_follow_the_steering_wheel_by_the_ratio_in_force(house: House) -> None:
    intake = house.conductor.intake
    house.drive(5)
    assert intake.latest is not None

    vehicle = house.plan.vehicle
    ratio = msgspec.structs.replace(vehicle.steering_ratio, value=10.0)
    state = msgspec.structs.replace(
        intake.latest.state, steering_wheel_rad=1.6, tire_angle_rad=1.6 / 16.0
    )
    measured = msgspec.structs.replace(state, tire_angle_rad=0.11)
    assert intake._with_tire_angle(state) == state
    intake.use_vehicle(msgspec.structs.replace(vehicle, steering_ratio=ratio))
    assert intake._with_tire_angle(state).tire_angle_rad == pytest.approx(0.16)
    assert intake._with_tire_angle(measured) == measured
