"""What strangers send to a drive is refused, told once and counted; the drive goes on."""

from __future__ import annotations

import pickle
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pyarrow.parquet as pq
import pytest

from foretwin.contracts.codec import encode
from foretwin.contracts.drive import PlannedTrajectory, RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.guard import Refused
from foretwin.contracts.keys import CHANNELS, TELEMETRY_CHANNELS, alive_key, key
from foretwin.contracts.mailbox import Alive, Received, Request
from foretwin.contracts.refusal_counts import OwnRefusals, RefusalFile, RefusedKind
from foretwin.contracts.tuning import SetRequest
from foretwin.orchestrator.drive.refusal_handler import RefusalHandler
from foretwin.orchestrator.drive.standing import heard_of
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.runtime_configuration.handler import NOT_TO_BE_SET
from tests.contracts.hostile_messages import HOSTILE, hostile_bytes
from tests.orchestrator.house import House
from tests.orchestrator.trip import START_NS

RUN_CHANNELS = ("mirror", "event", "identification", "gap", "gap_alarm", "verdict")


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def put(house: House, channel: str, data: bytes, *, on: str | None = None) -> None:
    ids = {"vehicle": "ego"} if "/vehicle/" in CHANNELS[channel].key else {"run": house.plan.run_id}
    full_key = on or key(channel, **ids)
    house.conductor.handle(Received(channel, full_key, data, CHANNELS[channel].kind))


def refused(house: House) -> dict[tuple[str, str], int]:
    rows = house.conductor.refusals.record()["refused"]["by_sender"]
    return {(row["sender"].rsplit("/", 1)[-1], row["reason"]): row["count"] for row in rows}


def test_a_kind_of_refusal_is_told_once(tmp_path: Path) -> None:
    told: list[Notice] = []
    handler = RefusalHandler(told.append, tmp_path)
    for _ in range(3):
        handler.take(Refused("run/r/mirror", "no message"))
        handler.leave_out("objects", 2)

    assert [notice.level for notice in told] == ["error", "warning"]
    assert handler.record()["refused"]["count"] == 3 + 6


def test_what_other_processes_refuse_is_told_once_of_each_kind(tmp_path: Path) -> None:
    told: list[Notice] = []
    handler = RefusalHandler(told.append, tmp_path)
    handler.take(Refused("run/r/mirror", "no message"))
    router, viewer = RefusalFile(tmp_path, "router"), RefusalFile(tmp_path, "viewer")

    def said(key: str, count: int) -> RefusedKind:
        return RefusedKind(sender="worker-w0", reason="say", key=key, count=count)

    router.write(OwnRefusals(kinds=(said("a", 1),)))
    known = RefusedKind(sender="run/r/mirror", reason="no message", count=1)
    viewer.write(OwnRefusals(kinds=(known,)))
    handler.look(0.0)
    router.write(OwnRefusals(kinds=(said("a", 2), said("b", 1))))
    handler.look(5.0)

    assert [notice.text.split(";")[0] for notice in told] == [
        "refused: run/r/mirror: no message",
        "refused: worker-w0 may not say a",
    ]
    record = handler.record()
    assert (record["refused"]["count"], record["refused_by_router"]["count"]) == (1, 3)
    assert record["refused_by_processes"]["count"] == 1


def test_the_folder_is_not_read_more_often_than_each_second(tmp_path: Path) -> None:
    told: list[Notice] = []
    handler = RefusalHandler(told.append, tmp_path)
    handler.look(10.0)
    kinds = (RefusedKind(sender="", reason="no password", count=1),)
    RefusalFile(tmp_path, "router").write(OwnRefusals(kinds=kinds))
    handler.look(10.5)
    assert told == []
    handler.look(11.0)
    assert len(told) == 1


def test_bytes_that_are_no_message_change_nothing(house: House) -> None:
    """Each of these once ended a drive, or left it without its tables."""
    house.drive(40, round_every=5)
    put(house, "mirror", b"hello")
    put(house, "mirror", b"hello")
    put(house, "event", b"")
    for channel in (*TELEMETRY_CHANNELS, *RUN_CHANNELS):
        put(house, channel, b"on everything", on="**")
    house.drive(80, round_every=5)
    house.end()

    found = refused(house)
    assert found["mirror", "no message"] == 2
    assert found["**", "sent to many keys at once"] == len(TELEMETRY_CHANNELS) + len(RUN_CHANNELS)
    told = [event.text for event in house.watched("event") if event.level == "error"]
    assert len(told) == len(found)
    assert house.conductor.intake.states == 80
    assert pq.read_table(house.plan.folder / "results" / "rounds.parquet").num_rows == 15


def test_a_plan_whose_arrays_differ_in_length_is_no_plan(house: House) -> None:
    house.drive(20)
    arrays = {name: np.ones(4) for name in ("time_from_stamp_s", "lat_deg", "lon_deg", "yaw_rad")}
    plan = PlannedTrajectory(stamp_ns=START_NS, speed_mps=np.ones(3), **arrays)
    house.bus.publish("plan", plan, vehicle="ego")
    house.drive(30, round_every=5)

    assert house.conductor.intake.plan is None
    assert refused(house) == {("plan", "PlannedTrajectory: speed_mps of another shape"): 1}
    assert house.conductor.rounds.futures.rounds == 2


def detected(house: House, number: int, **changed: Any) -> RoadUser:
    state = house.states[number]
    fields = {
        "user_id": "7", "kind": "car", "position": state.position, "yaw_rad": 0.0,
        "speed_mps": 1.0, "length_m": 4.0, "width_m": 1.8,
    }  # fmt: skip
    return RoadUser(**(fields | changed))


def test_of_detections_those_that_cannot_be_are_left_out_and_counted(house: House) -> None:
    house.drive(40)
    far = GeoPoint(52.0, float("nan"))
    users = (
        detected(house, 40),
        detected(house, 40, user_id="8", speed_mps=float("inf")),
        detected(house, 40, user_id="9", width_m=0.0),
        detected(house, 40, user_id="10", position=far),
    )
    seen = RoadUsers(stamp_ns=house.states[40].stamp_ns, users=users)
    house.bus.publish("objects", seen, vehicle="ego")
    house.drive(60, round_every=5)

    assert refused(house) == {("objects", "road users that cannot be"): 3}
    assert house.conductor.intake.road_users == msgspec.structs.replace(seen, users=users[:1])
    assert house.conductor.rounds.futures.rounds == 4
    assert house.conductor.rounds.failed_jobs == 0


@pytest.mark.parametrize("name", ["a b", "w{0}", "w0?", "\x1b[2J", "x" * 500])
def test_a_token_of_no_plain_name_gets_no_questions(house: House, name: str) -> None:
    token = alive_key(run=house.plan.run_id, process="w9").removesuffix("w9") + name
    house.conductor.handle(Alive(token, True, 0))

    assert list(refused(house).values()) == [1]
    assert house.conductor.rounds.dispatcher.workers == ("w0", "w1")


def test_a_question_that_is_none_is_answered_and_counted(house: House) -> None:
    said: list[str] = []
    question = Request("set", key("set", run="r"), b"hello", lambda _, reason: said.append(reason))
    house.conductor.handle(question)

    assert "not a foretwin message" in said[0]
    assert refused(house) == {("set", "no message"): 1}


def test_an_answer_that_is_not_of_its_job_counts_as_refused(house: House) -> None:
    house.drive(20)
    sick = house.workers[0]
    sick.spoil = lambda result: msgspec.structs.replace(result, future_indices=(7, 8, 9))
    house.conductor.start_round()
    house.work()

    assert house.conductor.rounds.failed_jobs > 0
    assert any("not asked for" in event.text for event in house.watched("event"))


@pytest.mark.parametrize("seed", range(4))
def test_whatever_strangers_send_the_drive_goes_on(tmp_path: Path, seed: int) -> None:
    chance = random.Random(seed)
    house = House(tmp_path, route="live", source="live")
    channels = (*TELEMETRY_CHANNELS, "route", *RUN_CHANNELS)
    house.drive(30, round_every=5)
    for number in range(30, 60):
        for channel in channels:
            if channel != "end":  # one that is well formed does end the drive
                for _ in range(3):
                    put(house, channel, hostile_bytes(CHANNELS[channel].kind, chance))
        for name in HOSTILE:
            if isinstance(name, str):
                house.conductor.handle(Alive(f"foretwin/v1/run/r/alive/{name}", True, 0))
        house.drive(number + 1, round_every=5)
        house.conductor.make_changes()
    house.end()

    assert not house.tables.troubles
    assert house.conductor.refusals.record()["refused"]["count"] > 500
    assert house.conductor.intake.counts.received > 60


def test_what_cannot_be_set_is_answered_and_counted(house: House) -> None:
    said: list[bytes | None] = []
    asked = encode(SetRequest(key="vehicle.../../etc/passwd", value="rogue"))
    question = Request("set", key("set", run="r"), asked, lambda data, _: said.append(data))
    house.conductor.handle(question)

    assert said[0] is not None
    assert b"etc/passwd" in said[0]
    assert refused(house) == {("set", NOT_TO_BE_SET): 1}


def test_an_orchestrator_that_goes_on_knows_what_was_told(house: House) -> None:
    house.drive(20)
    kinds = (RefusedKind(sender="viewer", reason="say", key="a", count=1),)
    RefusalFile(house.plan.processes_dir, "router").write(OwnRefusals(kinds=kinds))
    house.conductor.refusals.look(1.0)
    heard = pickle.loads(heard_of(house.conductor))
    assert heard.refusals_told == {(True, "viewer", "say")}
