"""Changes of a running drive: refused in one line or made between rounds, told and kept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.keys import alive_key
from foretwin.contracts.mailbox import Mailbox, Reply
from foretwin.contracts.roles import UseRoles
from foretwin.contracts.tuning import SetReply, SetRequest
from foretwin.orchestrator.commands.set import ask_drive
from foretwin.orchestrator.runtime_configuration.handler import (
    Change,
    Made,
    RefusedError,
    RuntimeConfiguration,
)
from tests.orchestrator.house import House, Process
from tests.orchestrator.trip import START_NS

COVERS = (
    "foretwin.orchestrator.drive.questions",
    "foretwin.orchestrator.runtime_configuration.handler",
    "foretwin.orchestrator.runtime_configuration.roles",
)


class Mirror(Process):
    """Answers what it is told of roles and Worlds, and remembers it."""

    def __init__(self, house: House) -> None:
        self.told: list[UseRoles] = []
        super().__init__(house.plan, house.bus, "mirror", ("use_world", "use_roles"), at_once=True)
        house.settle()

    def answer_one(self, request: Any) -> None:
        message = request.message()
        if isinstance(message, UseRoles):
            self.told.append(message)
        request.reply(message)


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.tables.close()


def ask(house: House, key: str, value: str) -> Mailbox:
    """Ask for a change as `foretwin set` does; the answer lands in the mailbox."""
    answers = Mailbox(1)
    request = SetRequest(key=key, value=value)
    house.bus.request("set", request, answers, run=house.plan.run_id)
    house.settle()
    return answers


def answer(answers: Mailbox) -> SetReply | None:
    reply = answers.take()
    if reply is None:
        return None
    assert isinstance(reply, Reply)
    assert isinstance(reply.message, SetReply)
    return reply.message


def test_a_change_counts_from_the_next_state_and_is_told_kept_and_answered(house: House) -> None:
    mirror = Mirror(house)
    house.drive(20)
    answers = ask(house, "role.ego", "shadow")
    assert answer(answers) is None
    house.conductor.make_changes()

    now_ns = house.states[19].stamp_ns
    done = answer(answers)
    assert done is not None
    assert done.done
    assert (
        done.text
        == f"role.ego: all -> shadow, from {(now_ns - START_NS) / 1e9:.2f} s of the drive on"
    )
    assert mirror.told[-1] == UseRoles(
        stamp_ns=now_ns + 1, roles={"ego": "shadow"}, correction="free"
    )
    assert house.conductor.questions.unanswered == 1
    house.settle()
    assert house.conductor.questions.unanswered == 0
    assert "set role.ego: all -> shadow" in [event.text for event in house.watched("event")]
    (kept,) = house.conductor.changes.record(START_NS)
    assert kept == {
        "drive_time_s": pytest.approx((now_ns + 1 - START_NS) / 1e9), "stamp_ns": now_ns + 1,
        "asked_stamp_ns": now_ns, "key": "role.ego", "before": "all", "value": "shadow",
    }  # fmt: skip
    house.end()
    table = pq.read_table(house.plan.folder / "results" / "changes.parquet")
    assert [row["key"] for row in table.to_pylist()] == ["role.ego"]


def test_a_change_waits_for_the_round_that_runs(house: House) -> None:
    house.drive(25)
    assert house.conductor.start_round()
    answers = ask(house, "correction", "follow")
    house.conductor.make_changes()
    assert answer(answers) is None
    house.work()
    house.conductor.make_changes()
    done = answer(answers)
    assert done is not None
    assert done.text.startswith("correction: free -> follow, from ")


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("role.ego", "wheel", "role.ego=wheel: must be all, twin, shadow, ghost"),
        ("role.lorry", "twin", "role.lorry: no such vehicle in this drive; there are: ego"),
        ("correction", "yes", "correction=yes: must be correction=free or correction=follow"),
        ("correction.ego", "free",
         "correction.ego=free: must be correction=free or correction=follow"),
        ("speed", "3", "speed: unknown key; can be set: role.ID, correction, vehicle.NAME, "
             "virtual_traffic, light.GROUP"),
    ],
)  # fmt: skip
def test_what_cannot_be_set_is_refused_in_one_line(
    house: House, key: str, value: str, told: str
) -> None:
    refused = answer(ask(house, key, value))
    assert refused == SetReply(done=False, text=told)
    assert not house.conductor.changes.waiting


def test_what_waits_as_the_drive_ends_is_refused(house: House) -> None:
    answers = ask(house, "role.ego", "twin")
    house.conductor.changes.refuse_all("the drive is over")
    assert answer(answers) == SetReply(done=False, text="the drive is over")
    assert not house.conductor.changes.made


def test_a_mirror_that_comes_back_is_told_what_counts(house: House) -> None:
    first = Mirror(house)
    assert [told.roles for told in first.told] == [{"ego": "all"}]
    ask(house, "role.ego", "ghost")
    house.conductor.make_changes()
    house.bus.lose(alive_key(run=house.plan.run_id, process=first.process_id))
    house.settle()
    second = Mirror(house)
    assert [told.roles for told in second.told] == [{"ego": "ghost"}]


class Dial:
    """A handler of a kind of its own, such as another room may bring."""

    keys = "dial.NAME"

    def __init__(self) -> None:
        self.at = {"left": "0"}

    def check(self, name: str, value: str) -> None:
        if name not in self.at:
            raise RefusedError(f"dial.{name}: no such dial")

    def make(self, name: str, value: str, *, stamp_ns: int) -> Made:
        if value == self.at[name]:
            raise RefusedError(f"dial.{name}: stands at {value}")
        before, self.at[name] = self.at[name], value
        return Made(before, value)


def test_a_handler_may_refuse_once_its_turn_has_come(house: House) -> None:
    handler = RuntimeConfiguration({"dial": Dial()})
    house.bus.serve("set", box := Mailbox(8), run="r")
    answers = [Mailbox(1), Mailbox(1)]
    for one in answers:
        request = SetRequest(key="dial.left", value="7")
        house.bus.request("set", request, one, run="r")
        handler.take(box.take(), stamp_ns=5)
    made = handler.make(stamp_ns=9, start_stamp_ns=0)
    assert made == [Change(9, 5, "dial.left", "0", "7")] == list(handler.made)
    first, second = (answer(one) for one in answers)
    assert first is not None
    assert first.done
    assert second == SetReply(done=False, text="dial.left: stands at 7")


def test_asking_where_nobody_serves_says_so(house: House) -> None:
    with pytest.raises(ValueError, match=r"run other does not answer: .*no answer"):
        ask_drive(house.bus, "other", SetRequest(key="role.ego", value="twin"), timeout_s=1.0)
