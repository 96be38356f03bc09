"""Who may say what: from the table of channels to what a router lets through."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.access import BusMember, access_control, may_say, role_of
from foretwin.contracts.bus import Bus, BusUnreachable, Mailbox, ZenohBus
from foretwin.contracts.credentials import (
    USERS,
    Credentials,
    credentials_file,
    make_credentials,
    read_credentials,
)
from foretwin.contracts.drive import SpeedSample, VehicleState
from foretwin.contracts.keys import CHANNELS, alive_key
from foretwin.contracts.keys import key as channel_key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.process_setup import Admission, BusSetup
from foretwin.contracts.simulation import PrepareRequest, RunEnd
from foretwin.contracts.towards_vehicle import Authority
from tests.contracts.bus_sides import DEADLINE_S, take, take_until

RUN = "r1"
MEMBERS = (
    BusMember("orchestrator", "orchestrator", "orchestrator"),
    BusMember("worker-w0", "worker", "w0"),
    BusMember("worker-w1", "worker", "w1"),
    BusMember("car-vehicle", "car", "vehicle", "ego"),
    BusMember("viewer", "viewer", "viewer", beside=("copilot",)),
    BusMember("recorder", "recorder", "recorder"),
    BusMember("operator", "operator"),
    BusMember("planner", "planner"),
)


class House:
    """A router that knows its clients by their passwords, and clients of it."""

    def __init__(self, stack: ExitStack, folder: Path) -> None:
        self._stack, self.folder = stack, folder
        access = access_control(MEMBERS, subject="usernames", run_id=RUN)
        make_credentials(folder, [one.name for one in MEMBERS])
        admits = Admission(access=json.dumps(access), users_file=str(folder / USERS))
        self.endpoint = free_endpoint()
        stack.enter_context(ZenohBus(BusSetup(endpoint=self.endpoint, admits=admits), router=True))

    def join(self, user: str) -> ZenohBus:
        shown = str(credentials_file(self.folder, user))
        setup = BusSetup(endpoint=self.endpoint, credentials=shown)
        return self._stack.enter_context(ZenohBus(setup))


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    with ExitStack() as stack:
        yield House(stack, tmp_path)


@contextmanager
def heard(house: House, channel: str, **ids: str) -> Iterator[Mailbox]:
    """What the viewer hears on a channel."""
    mailbox = Mailbox(64)
    house.join("viewer").subscribe(channel, mailbox, **ids)
    yield mailbox


def only(mailbox: Mailbox, honest: Bus, channel: str, message: Any, **ids: str) -> None:
    """Assert that of all that was said, what an honest one says next is the first to be heard."""
    honest.publish(channel, message, **ids)
    item = take(mailbox)
    assert item.message() == message
    assert mailbox.take_last(0.3) is None


def test_a_worker_cannot_speak_as_the_car(house: House) -> None:
    with heard(house, "speed", vehicle="ego") as mailbox:
        worker, car = house.join("worker-w0"), house.join("car-vehicle")
        for _ in range(5):
            worker.publish("speed", SpeedSample(stamp_ns=1, speed_mps=99.0), vehicle="ego")
        only(mailbox, car, "speed", SpeedSample(stamp_ns=2, speed_mps=3.0), vehicle="ego")


def keys_of(subject: str, message: str) -> set[str]:
    """Return the keys on which somebody may send such messages."""
    access = access_control(MEMBERS, subject="usernames", run_id=RUN)
    rules = {one["id"]: one for one in access["rules"]}
    subjects = {one["id"] for one in access["subjects"] if subject in one.get("usernames", ())}
    return {
        key
        for policy in access["policies"]
        if subjects & set(policy["subjects"])
        for rule in policy["rules"]
        if message in rules[rule]["messages"] and rules[rule]["permission"] == "allow"
        for key in rules[rule]["key_exprs"]
    }


def test_a_car_speaks_of_itself_alone_and_the_orchestrator_of_every_vehicle() -> None:
    assert channel_key("gnss", vehicle="ego") in keys_of("car-vehicle", "put")
    assert channel_key("gnss", vehicle="*") not in keys_of("car-vehicle", "put")
    assert channel_key("state", vehicle="*") in keys_of("orchestrator", "put")


@pytest.mark.parametrize("user", [one.name for one in MEMBERS if one.role != "orchestrator"])
def test_nobody_but_the_orchestrator_is_in_charge_or_ends_a_drive(house: House, user: str) -> None:
    with heard(house, "authority", run=RUN) as charge, heard(house, "run_end", run=RUN) as ends:
        rogue, orchestrator = house.join(user), house.join("orchestrator")
        rogue.publish("authority", Authority(sent_mono_ns=1), run=RUN)
        rogue.publish("run_end", RunEnd(stamp_ns=1), run=RUN)
        only(charge, orchestrator, "authority", Authority(sent_mono_ns=2), run=RUN)
        only(ends, orchestrator, "run_end", RunEnd(stamp_ns=2), run=RUN)


def test_nobody_holds_anothers_token_or_answers_in_its_place(house: House) -> None:
    tokens, questions, replies = Mailbox(8), Mailbox(8), Mailbox(8)
    orchestrator = house.join("orchestrator")
    orchestrator.watch_alive(alive_key(run="*", process="*"), tokens)
    rogue, honest = house.join("worker-w1"), house.join("worker-w0")
    for process in ("w0", "mirror", "stranger", "orchestrator"):
        rogue.declare_alive(alive_key(run=RUN, process=process))
    taken = Mailbox(8)
    rogue.serve("prepare", taken, run=RUN, process="w0")
    honest.serve("prepare", questions, run=RUN, process="w0")
    honest.declare_alive(alive_key(run=RUN, process="w0"))
    assert take(tokens).key == alive_key(run=RUN, process="w0")
    orchestrator.request(
        "prepare", PrepareRequest(world_id="a"), replies, timeout_s=DEADLINE_S, run=RUN,
        process="w0",
    )  # fmt: skip
    take(questions).refuse("no")
    assert take(replies).error == "no"
    assert (tokens.take_last(0.3), taken.take()) == (None, None)


@pytest.mark.parametrize("anew", [False, True])
def test_what_the_car_keeps_is_given_to_who_comes_late(house: House, anew: bool) -> None:
    car = house.join("car-vehicle")
    car.go_on_as(None)
    for number in range(5):
        sample = SpeedSample(stamp_ns=number, speed_mps=1.0)
        car.publish("speed", sample, vehicle="ego")
    if anew:
        house.join("car-vehicle").go_on_as(car)
        car.close()
    mailbox = Mailbox(64)
    house.join("recorder").subscribe("speed", mailbox, recover=True, vehicle="ego")
    stamps = set()
    take_until(mailbox, lambda item: stamps.add(item.message().stamp_ns) or len(stamps) == 5)


@pytest.mark.parametrize(
    ("user", "password"), [(None, ""), ("worker-w0", "wrong"), ("nobody", "secret")]
)
def test_who_shows_nothing_or_something_wrong_is_let_in_nowhere(
    house: House, monkeypatch: pytest.MonkeyPatch, user: str | None, password: str
) -> None:
    monkeypatch.setattr("foretwin.contracts.zenoh_config.CONNECT_S", 0.3)
    shown = None
    if user is not None:
        shown = str(house.folder / "rogue.json")
        one = Credentials(user=user, password=password)
        Path(shown).touch(0o600)
        Path(shown).write_bytes(msgspec.json.encode(one))
    with pytest.raises(BusUnreachable):
        ZenohBus(BusSetup(endpoint=house.endpoint, credentials=shown))


def test_every_channel_has_one_who_may_say_it_and_the_state_is_the_orchestrators() -> None:
    for channel in CHANNELS.values():
        assert channel.writers
        assert (channel.server is None) == (channel.reply is None)
    state = CHANNELS["state"]
    assert state.kind is VehicleState
    assert [one.name for one in MEMBERS if may_say(one, state)] == ["orchestrator"]


def test_all_is_denied_that_no_rule_allows_and_each_subject_is_of_its_kind() -> None:
    for subject in ("usernames", "cert_common_names"):
        made = access_control(MEMBERS, subject=subject)
        assert (made["enabled"], made["default_permission"]) == (True, "deny")
        assert {rule["permission"] for rule in made["rules"]} == {"allow"}
        assert [one[subject] for one in made["subjects"]] == [[one.name] for one in MEMBERS]


def test_passwords_differ_and_lie_where_nobody_else_reads(tmp_path: Path) -> None:
    make_credentials(tmp_path, ["a", "b"])
    shown = [read_credentials(credentials_file(tmp_path, user)) for user in ("a", "b")]
    assert [one.user for one in shown] == ["a", "b"]
    assert len({one.password for one in shown}) == 2
    assert all(len(one.password) >= 32 for one in shown)
    assert {file.stat().st_mode & 0o777 for file in tmp_path.iterdir()} == {0o600}


def test_a_name_tells_the_role() -> None:
    assert {one.name: role_of(one.name) for one in MEMBERS} == {
        one.name: one.role for one in MEMBERS
    }
    assert role_of("car-of-ego") == "car"
    assert role_of("carpenter") is None
    assert role_of("") is None
