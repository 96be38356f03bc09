"""Lock step: samples in the order of their stamps, every round complete, who is stuck is named."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.codec import encode
from foretwin.contracts.drive import AdvanceReply, DriveEnd, GnssFix, SpeedSample
from foretwin.contracts.keys import alive_key
from foretwin.contracts.mailbox import Mailbox, Received, Request
from foretwin.contracts.simulation import PlaneState
from foretwin.contracts.tuning import SetRequest
from foretwin.orchestrator.drive import lock_step
from foretwin.orchestrator.drive.lock_step import LockStepError, LockStepLoop
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.contracts.mirror_samples import mirror_sample
from tests.orchestrator.house import AtOnce, House
from tests.orchestrator.trip import START_NS

NOWHERE = PlaneState(0.0, 0.0, 0.0, 0.0)


class Car:
    """The vehicle's process: publishes up to a stamp when asked, channel by channel."""

    def __init__(
        self, house: House, *, until_s: float, channels: tuple[str, ...], speed_after_ns: int = 1
    ) -> None:
        self._bus = house.bus
        self._channels = channels
        end_ns = START_NS + round(until_s * 1e9)
        self._waiting: list[tuple[str, Any]] = []
        for state in house.states:
            if state.stamp_ns <= end_ns:
                self._waiting += [
                    ("gnss", GnssFix(stamp_ns=state.stamp_ns, position=state.position)),
                    (
                        "speed",
                        SpeedSample(stamp_ns=state.stamp_ns + speed_after_ns, speed_mps=10.0),
                    ),
                ]
        self.published: dict[str, int] = {}
        house.bus.serve("advance", AtOnce(self._advance), vehicle="ego")  # type: ignore[arg-type]

    def _advance(self, request: Request) -> None:
        until_ns = request.message().until_stamp_ns
        due = [pair for pair in self._waiting if pair[1].stamp_ns <= until_ns]
        self._waiting = self._waiting[len(due) :]
        for channel in self._channels:
            for name, message in due:
                if name == channel:
                    self._publish(name, message)
        if not self._waiting:
            self._publish("end", DriveEnd(stamp_ns=until_ns, published=dict(self.published)))
        request.reply(AdvanceReply(published=dict(self.published), ended=not self._waiting))

    def _publish(self, channel: str, message: Any) -> None:
        self._bus.publish(channel, message, vehicle="ego")
        self.published[channel] = self.published.get(channel, 0) + 1


def add_mirror(house: House) -> list[str | None]:
    """Add a mirror that answers every state; returns the Worlds that it is told of."""
    told: list[str | None] = []

    def use(request: Request) -> None:
        active = request.message()
        told.append(active.world_id)
        request.reply(active)

    def mirror(received: Received) -> None:
        sample = mirror_sample(received.message().stamp_ns, NOWHERE, independent=False)
        house.bus.publish("mirror", sample, run=house.plan.run_id)

    run = house.plan.run_id
    house.bus.serve("use_world", AtOnce(use), run=run, process="mirror")  # type: ignore[arg-type]
    house.bus.subscribe("state", AtOnce(mirror), vehicle="ego")  # type: ignore[arg-type]
    house.bus.declare_alive(alive_key(run=run, process="mirror"))
    house.settle()
    return told


@pytest.fixture
def houses(tmp_path: Path) -> Iterator[Any]:
    made: list[House] = []

    def make(**settings: Any) -> House:
        folder = tmp_path / str(len(made))
        house = House(folder, **{"at_once": True, "speed": None, "rate_hz": 1.0, **settings})
        made.append(house)
        return house

    yield make
    for house in made:
        house.tables.close()


def loop(house: House, *, stop_after: int | None = None) -> LockStepLoop:
    asked = 0

    def stop() -> bool:
        nonlocal asked
        asked += 1
        return stop_after is not None and asked > stop_after

    return LockStepLoop(house.conductor, housekeeping=lambda _: None, stop=stop)


def test_a_drive_goes_to_its_end_with_a_round_every_period(houses: Any) -> None:
    house = houses()
    told = add_mirror(house)
    car = Car(house, until_s=12.0, channels=("gnss", "speed"))

    assert loop(house).run()
    rounds = house.conductor.rounds
    # One for each second but those before the heading is known and the last.
    assert rounds.futures.rounds + house.conductor.rounds.tally.unseeded in (11, 12, 13)
    assert rounds.futures.rounds >= 10
    ledger = house.conductor.rounds.tally.ledger()
    assert (ledger.balanced(), ledger.missed, ledger.run) == (True, 0, rounds.futures.rounds)
    assert house.conductor.intake.counts.received == car.published["gnss"] + car.published["speed"]
    assert house.conductor.intake.counts.lost == 0
    assert [world for world in told if world] == list(dict.fromkeys(w for w in told if w))


def test_results_do_not_depend_on_who_arrives_first_nor_on_the_number_of_workers(
    houses: Any,
) -> None:
    hashes, states = set(), set()
    for channels, workers in (
        (("gnss", "speed"), 2),
        (("speed", "gnss"), 2),
        (("speed", "gnss"), 1),
    ):
        house = houses(workers=workers)
        add_mirror(house)
        Car(house, until_s=8.0, channels=channels)
        assert loop(house).run()
        hashes.add(
            house.conductor.rounds.futures.record(wanted=6, missed=0, spared=0, unseeded=0)[
                "sha256"
            ]
        )
        latest = house.conductor.intake.latest
        assert latest is not None
        states.add(msgspec.json.encode(latest.state))

    assert (len(hashes), len(states)) == (1, 1)


def test_of_an_instant_the_position_is_taken_last_as_without_lock_step(
    houses: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken, handle = [], StateEstimator.handle

    def watched(estimator: StateEstimator, channel: str, message: Any, **options: Any) -> Any:
        taken.append((message.stamp_ns, channel))
        return handle(estimator, channel, message, **options)

    monkeypatch.setattr(StateEstimator, "handle", watched)
    house = houses()
    add_mirror(house)
    Car(house, until_s=3.0, channels=("gnss", "speed"), speed_after_ns=0)
    assert loop(house).run()

    stamps = sorted({stamp_ns for stamp_ns, _ in taken})
    assert taken == [(stamp_ns, channel) for stamp_ns in stamps for channel in ("speed", "gnss")]


def test_a_change_asked_for_during_a_round_counts_before_the_next_one(houses: Any) -> None:
    house = houses()
    add_mirror(house)
    Car(house, until_s=8.0, channels=("gnss", "speed"))
    stamps_ns: list[int] = []
    answers = Mailbox(1)

    def after_third_round(received: Received) -> None:
        stamps_ns.append(received.message().stamp_ns)
        if len(stamps_ns) == 3:
            request = SetRequest(key="role.ego", value="ghost")
            house.bus.request("set", request, answers, run=house.plan.run_id)

    house.bus.subscribe("round", AtOnce(after_third_round), run=house.plan.run_id)  # type: ignore[arg-type]
    assert loop(house).run()
    (change,) = house.conductor.changes.made
    assert change.asked_stamp_ns == stamps_ns[2]
    assert change.stamp_ns == stamps_ns[3] + 1
    assert answers.take().message.done


def test_a_vehicle_that_does_not_answer_is_named(houses: Any) -> None:
    house = houses()

    with pytest.raises(LockStepError, match="the vehicle's process does not answer: no answer"):
        loop(house).run()


def test_a_worker_that_is_stuck_is_named(houses: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lock_step, "STUCK_AFTER_S", 0.3)
    house = houses()
    add_mirror(house)
    Car(house, until_s=8.0, channels=("gnss", "speed"))
    for worker in house.workers:
        held = worker.answer_one

        def loads_alone(request: Request, held: Any = held) -> None:
            if request.channel == "prepare":
                held(request)
            else:
                kept.append(request)

        worker.requests.put = loads_alone
    kept: list[Request] = []

    with pytest.raises(LockStepError, match="for the round"):
        loop(house).run()


def test_a_builder_that_is_stuck_is_named(houses: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lock_step, "STUCK_AFTER_S", 0.3)
    house = houses()
    add_mirror(house)
    Car(house, until_s=8.0, channels=("gnss", "speed"))
    kept: list[Request] = []
    house.builder.requests.put = kept.append

    with pytest.raises(LockStepError, match="for worlds"):
        loop(house).run()
    assert kept


def test_a_drive_that_is_stopped_says_so(houses: Any) -> None:
    house = houses()
    add_mirror(house)
    Car(house, until_s=100.0, channels=("gnss", "speed"))

    assert not loop(house, stop_after=200).run()
    assert house.conductor.intake.end is None


def test_a_sample_of_another_schema_is_refused_and_the_drive_goes_on(houses: Any) -> None:
    house = houses()
    add_mirror(house)
    Car(house, until_s=5.0, channels=("gnss", "speed"))
    foreign = bytearray(encode(SpeedSample(stamp_ns=START_NS, speed_mps=10.0)))
    foreign[4] = 99
    key = "foretwin/v1/vehicle/ego/telemetry/speed"
    house.conductor.mailbox.put(Received("speed", key, bytes(foreign), SpeedSample))

    assert loop(house).run()
    assert house.conductor.intake.refused == 1
    assert house.conductor.rounds.futures.rounds > 0
