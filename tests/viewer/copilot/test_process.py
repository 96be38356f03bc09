"""The display's process over a real bus: what a page gets, and what its death costs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import msgspec
import pytest

from foretwin.contracts.bus import Mailbox, Request, ZenohBus
from foretwin.contracts.keys import alive_key
from foretwin.contracts.marks import MarkReply
from foretwin.contracts.page_address import FRAMES_FILE
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.simulation import ActiveWorld, RunEnd
from foretwin.contracts.tuning import SetReply
from foretwin.viewer.copilot.frames_file import KeptFrames
from tests.contracts.bus_sides import DEADLINE_S
from tests.viewer import scene
from tests.viewer.copilot.display import RUN, DisplayRun
from tests.viewer.copilot.test_now import AHEAD_OF_X1, a_round

COVERS = ("foretwin.viewer.copilot.__main__",)

Start = Callable[..., DisplayRun]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    runs: list[DisplayRun] = []

    def started(**settings: Any) -> DisplayRun:
        runs.append(DisplayRun(tmp_path, **settings))
        return runs[-1]

    yield started
    for run in runs:
        run.close()


def drive_a_moment(run: DisplayRun) -> None:
    run.send("active_world", ActiveWorld(stamp_ns=scene.START_NS, world_id=scene.WORLD_ID))
    run.send("progress", AHEAD_OF_X1)
    run.send("mirror", scene.mirror_at(4.0))
    run.send("round", a_round())
    run.send("state", scene.state_at(4.0))


def test_a_drive_is_on_the_page_and_what_was_shown_is_kept(start: Start) -> None:
    run = start()
    frames = run.frames()
    assert next(frames).sentence == "waiting for the drive"
    drive_a_moment(run)
    begun_s = time.monotonic()
    shown = next(one for one in frames if one.danger is not None and one.pose is not None)
    assert time.monotonic() - begun_s < DEADLINE_S
    assert shown.danger is not None
    assert shown.level == "danger"
    assert shown.world_id == scene.WORLD_ID
    assert run.ask("GET", f"plan/{scene.WORLD_ID}")[1]["junction_id"] == "x1"
    assert run.ask("GET", "plan/elsewhere")[0] == 404
    assert run.ask("GET", "about")[1]["may_change"] is False
    assert run.ask("POST", "change", {"key": "role.car", "value": "twin"})[0] == 409

    run.send("run_end", RunEnd(stamp_ns=1))
    last = list(frames)[-1]
    assert [one.text for one in last.alerts] == ["the run has ended"]
    assert run.process.wait(DEADLINE_S) == 0
    kept = KeptFrames(run.folder / FRAMES_FILE)
    assert kept.at(4.0).danger is not None


def test_another_seat_says_where_it_is_once_it_can_be_opened(start: Start) -> None:
    run = start(awaited=False)
    assert run.process.stdout is not None
    assert run.process.stdout.readline() == f"{RUN}: co-pilot display: {run.address}\n"
    assert run.ask("GET", "about")[0] == 200


def test_a_process_that_dies_is_on_the_page_and_comes_back(start: Start) -> None:
    run = start()
    with ZenohBus(run.setup.bus) as worker:
        worker.declare_alive(alive_key(run=RUN, process="w1"))
        run.frame_where(lambda one: bool(one.sentence))
        drive_a_moment(run)
        run.frame_where(lambda one: one.pose is not None)
    gone = run.frame_where(lambda one: any(alert.kind == "process" for alert in one.alerts))
    assert "process gone: w1" in [one.text for one in gone.alerts]
    with ZenohBus(run.setup.bus) as worker:
        worker.declare_alive(alive_key(run=RUN, process="w1"))
        run.frame_where(lambda one: all(alert.kind != "process" for alert in one.alerts))


def test_a_mark_is_asked_of_the_drive_and_its_silence_is_said(start: Start) -> None:
    run = start(seat="back seat")
    status, text = run.ask("POST", "mark", {})
    assert status == 409
    assert "does not answer" in text
    questions = Mailbox(4)
    run.bus.serve("mark", questions, run=RUN)

    def answer() -> None:
        item = questions.take(DEADLINE_S)
        assert isinstance(item, Request)
        asked.append(item.message())
        item.reply(MarkReply(mark_id=asked[-1].mark_id, stamp_ns=7, drive_time_s=1.5, count=3))

    asked: list[Any] = []
    thread = Thread(target=answer)
    thread.start()
    status, reply = run.ask("POST", "mark", {"note": "tram"})
    thread.join(DEADLINE_S)
    assert (status, reply["stamp_ns"]) == (200, 7)
    (mark,) = asked
    assert (mark.by, mark.note, mark.stamp_ns) == ("back seat", "tram", None)
    assert abs(mark.utc_ns - time.time_ns()) < DEADLINE_S * 1e9
    assert len(mark.mark_id) == 32
    run.frame_where(lambda one: one.marks == 3)


def test_roles_are_changed_as_the_operator(start: Start) -> None:
    endpoint = free_endpoint()
    run = start(operator=BusSetup(endpoint=endpoint))
    assert run.ask("GET", "about")[1]["may_change"] is True
    asked = {"key": "role.car", "value": "twin"}
    with ZenohBus(BusSetup(endpoint=endpoint), router=True) as drive:
        questions = Mailbox(4)
        drive.serve("set", questions, run=RUN)
        for done, status in ((True, 200), (False, 409)):
            thread = Thread(target=_answer, args=(questions, SetReply(done=done, text="so")))
            thread.start()
            said = run.ask("POST", "change", asked)
            thread.join(DEADLINE_S)
            assert said == (status, {"text": "so"} if done else "so\n")


def _answer(questions: Mailbox, reply: SetReply) -> None:
    item = questions.take(DEADLINE_S)
    assert isinstance(item, Request)
    item.reply(reply)


def test_killed_it_is_found_at_the_same_address_and_knows_the_drive_again(start: Start) -> None:
    run = start()
    drive_a_moment(run)
    run.frame_where(lambda one: one.pose is not None)
    run.process.kill()
    run.process.wait()
    run.start()
    drive_a_moment(run)
    again = run.frame_where(lambda one: one.danger is not None)
    assert again.world_id == scene.WORLD_ID


def test_what_is_no_message_changes_nothing(start: Start) -> None:
    run = start()
    drive_a_moment(run)
    odd = msgspec.structs.replace(a_round(), names=("one",))
    run.send("round", odd)
    run.send("state", scene.state_at(4.2))
    frame = run.frame_where(lambda one: one.drive_s > 4.1)
    assert frame.danger is not None
    assert run.process.poll() is None
