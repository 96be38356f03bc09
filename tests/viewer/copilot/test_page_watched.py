"""The page in a real browser beside a drive: alarms in time, nothing sent out, a browser frozen.

A judge; what it needs is in `test_page_read.py`.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.bus import Mailbox, Request, ZenohBus
from foretwin.contracts.codec import write_message
from foretwin.contracts.drive import SignalColour
from foretwin.contracts.keys import alive_key
from foretwin.contracts.lights import ShownLight, ShownLights, WhyShown
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.contracts.simulation import Event, RunEnd
from foretwin.contracts.tuning import SetReply, SetRequest
from foretwin.viewer.copilot.round_now import OLD_ROUND_S
from foretwin.viewer.danger import ROUND_FOR_S
from tests.contracts.bus_sides import DEADLINE_S
from tests.viewer import scene
from tests.viewer.copilot.chromium import Browser, judges_python
from tests.viewer.copilot.display import RUN, DisplayRun, served_page
from tests.viewer.copilot.page_heap import FRAMES_OF_AN_HOUR, measured
from tests.viewer.copilot.test_alerts import gap, injection, worker
from tests.viewer.copilot.test_now import AHEAD_OF_X1, Drive, a_round
from tests.viewer.copilot.test_right_of_way import drawn
from tests.viewer.copilot.test_words import verdict

pytestmark = [pytest.mark.judge, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    made = Browser()
    yield made
    made.close()


@pytest.fixture
def live(tmp_path: Path) -> Iterator[DisplayRun]:
    judges_python()
    run = DisplayRun(tmp_path)
    yield run
    run.close()


def go_on(run: DisplayRun, time_s: float) -> None:
    run.send("progress", AHEAD_OF_X1)
    run.send("mirror", scene.mirror_at(time_s))
    run.send("state", scene.state_at(time_s))


FORCED = {
    "ended": lambda run: run.send("run_end", RunEnd(stamp_ns=1)),
    "telemetry": lambda run: run.send(
        "state", msgspec.structs.replace(scene.state_at(5.0), stale=("gnss",))
    ),
    "verdict": lambda run: run.send("verdict", verdict("vehicle")),
    "gap": lambda run: run.send("gap_alarm", gap(over=True)),
    "rounds": lambda run: [run.send("round", a_round(late=True)) for _ in range(2)],
    "off the map": lambda run: run.send(
        "progress", msgspec.structs.replace(AHEAD_OF_X1, mission_state="off_map")
    ),
    "worker": lambda run: run.send("worker_status", worker("sick")),
    "injection": lambda run: run.send("injection", injection("shut")),
    "event": lambda run: run.send(
        "event", Event(stamp_ns=1, level="error", source="x", text="no world for n4")
    ),
    "process": lambda run: run.another.close(),
    "link": lambda run: run.bus.close(),
}


@pytest.mark.parametrize("kind", FORCED)
def test_an_alarm_is_on_the_first_screen_within_half_a_second(
    live: DisplayRun, browser: Browser, kind: str
) -> None:
    go_on(live, 4.0)
    live.send("round", a_round())
    go_on(live, 4.1)
    browser.do("open", url=live.address, size=(1024, 600))
    with ZenohBus(live.setup.bus) as live.another:
        live.another.declare_alive(alive_key(run=RUN, process="w1"))
        go_on(live, 4.2)
        browser.do("wait", selector="#alert[hidden]")
        begun_s = time.monotonic()
        FORCED[kind](live)
        browser.do("wait", selector="#alert:not([hidden])")
        took_s = time.monotonic() - begun_s
    inside = browser.do("box", selector="#alert")
    browser.do("close")
    assert took_s <= 0.5
    assert inside["top"] >= 0
    assert inside["bottom"] <= 600


def test_a_danger_older_than_its_bound_is_said_to_be_old_and_then_is_gone(
    live: DisplayRun, browser: Browser
) -> None:
    browser.do("open", url=live.address, size=(1024, 600))
    go_on(live, 4.0)
    live.send("round", a_round(4.0))
    browser.do("wait", selector="body[data-level=danger][data-old=no]")
    assert browser.do("text", selector="#odds").startswith("12 % · ")
    assert "old" not in browser.do("text", selector="#odds")
    # As on a busy machine: the newest round began long before the car is where it is.
    go_on(live, 4.1 + OLD_ROUND_S)
    browser.do("wait", selector="body[data-level=danger][data-old=yes]")
    assert browser.do("text", selector="#odds") == "12 % · 2 s old"
    go_on(live, 4.1 + ROUND_FOR_S)
    browser.do("wait", selector="body[data-level=none][data-current=yes]")
    said = browser.do("text", selector="#danger"), browser.do("text", selector="#odds")
    browser.do("close")
    assert said == ("no futures now", "")


def test_a_frame_that_waited_on_its_way_is_not_shown_as_current(browser: Browser) -> None:
    drive = Drive()
    drive.goes_on(4.0)
    drive.take("round", a_round())
    frame = msgspec.json.encode(drive.frame())
    stop = threading.Event()
    late_s = 0.0
    with served_page(lambda: frame) as (server, address):

        def go_on() -> None:
            while not stop.wait(0.1):
                server.publish(frame, time.monotonic() - late_s)

        feeding = threading.Thread(target=go_on)
        feeding.start()
        try:
            browser.do("open", url=address, size=(1024, 600))
            browser.do("wait", selector="body[data-level=danger][data-current=yes]")
            late_s = 20.0
            browser.do("wait", selector="body[data-level=none][data-current=no]")
            browser.do("wait", selector="#alert:not([hidden])")
            assert browser.do("text", selector="#danger") == "do not rely on this"
            assert browser.do("text", selector="#alert-text") == "this display is 20 s behind"
            late_s = 0.0
            browser.do("wait", selector="body[data-level=danger][data-current=yes]")
            assert browser.do("text", selector="#danger").startswith("car ")
            stop.set()
            browser.do("wait", selector="body[data-level=none][data-current=no]")
            browser.do("close")
        finally:
            stop.set()
            feeding.join()


@pytest.mark.parametrize("operator", [True, False], ids=["operator", "another seat"])
def test_the_light_ahead_is_flipped_and_given_back_by_the_operator_alone(
    tmp_path: Path, browser: Browser, operator: bool
) -> None:
    judges_python()
    endpoint = free_endpoint()
    run = DisplayRun(tmp_path, **({"operator": BusSetup(endpoint=endpoint)} if operator else {}))
    write_message(
        drawn("signal", "signal", group="g1"), tmp_path / f"worlds/{scene.WORLD_ID}.world"
    )
    asked: list[SetRequest] = []

    def say(why: WhyShown, colour: SignalColour) -> None:
        go_on(run, 4.0)
        run.send("round", a_round())
        light = ShownLight(group_id="g1", colour=colour, why=why)
        run.send("lights", ShownLights(stamp_ns=0, world_id=scene.WORLD_ID, lights=(light,)))

    def answer(item: object) -> None:
        assert isinstance(item, Request)
        asked.append(item.message())
        item.reply(SetReply(done=True, text="light.g1: done"))

    try:
        with ZenohBus(BusSetup(endpoint=endpoint), router=True) as drive:
            questions = Mailbox(4)
            drive.serve("set", questions, run=RUN)
            browser.do("open", url=run.address, size=(1024, 600))
            say("plan", "green")
            if not operator:
                browser.do("wait", selector="#twin-text:not(:empty)")
                browser.do("press", key="l")
                assert browser.do("box", selector="#flip")["width"] == 0
                assert questions.take(0.5) is None
                return
            browser.do("wait", selector="#flip:not([hidden])")
            assert browser.do("text", selector="#flip-state") == "green (plan)"
            assert browser.do("box", selector="#flip")["right"] <= 1024
            browser.do("press", key="l")
            answer(questions.take(DEADLINE_S))
            say("set", "red")
            browser.do("wait", selector="#flip[aria-pressed=true]")
            assert browser.do("text", selector="#flip-state") == "red (set)"
            assert browser.do("text", selector="#control-text") == "signals red"
            browser.do("click", selector="#flip")
            answer(questions.take(DEADLINE_S))
        assert [(one.key, one.value) for one in asked] == [
            ("light.g1", "red"),
            ("light.g1", "auto"),
        ]
    finally:
        browser.do("close")
        run.close()


def test_nothing_leaves_the_machine_and_a_frozen_browser_changes_nothing(
    live: DisplayRun, browser: Browser
) -> None:
    browser.do("open", url=live.address, size=(1024, 600))
    go_on(live, 1.0)
    browser.do("wait", selector="body[data-ready=yes]")
    browser.do("press", key=" ")
    assert browser.do("outside") == []
    frozen = browser.do("freeze")
    try:
        for number in range(50):
            go_on(live, 1.1 + 0.1 * number)
            live.frame_where(lambda one, at_s=1.05 + 0.1 * number: one.drive_s > at_s)
    finally:
        browser.do("thaw", pids=frozen)
    browser.do("close")
    assert live.process.poll() is None


def test_the_server_is_small_and_idle(live: DisplayRun, browser: Browser) -> None:
    """Of one core at most 3 %, with a page open and the car's usual rates, 150 MB at most."""
    browser.do("open", url=live.address, size=(1024, 600))
    before_s, begun_s = cpu_s(live.process.pid), time.monotonic()
    number = 0
    while time.monotonic() - begun_s < 20.0:
        time_s = number / 50.0
        live.send("state", scene.state_at(time_s))
        if number % 5 == 0:
            live.send("mirror", scene.mirror_at(time_s))
        if number % 12 == 0:
            live.send("progress", AHEAD_OF_X1)
        if number % 25 == 0:
            live.send("round", a_round(time_s))
        number += 1
        while time.monotonic() - begun_s < number / 50.0:
            time.sleep(0.002)
    share = (cpu_s(live.process.pid) - before_s) / (time.monotonic() - begun_s)
    heap_mb = browser.do("heap_mb")
    browser.do("close")
    resident_mb = rss_mb(live.process.pid)
    print(f"share of a core {share:.3f}, resident {resident_mb:.0f} MB, page heap {heap_mb:.1f} MB")
    assert share <= 0.03
    assert resident_mb <= 150.0
    assert heap_mb <= 200.0


def test_an_hours_frames_leave_nothing_in_the_page(browser: Browser) -> None:
    """An hour's frames, at twenty times their pace: what is kept comes with frames alone.

    `python -m tests.viewer.copilot.page_heap` takes the hour itself.
    """
    seen = list(measured(browser, count=FRAMES_OF_AN_HOUR, rate_hz=100.0, looks=6))
    print(*(f"{one.frames} frames: {one.heap_mb:.2f} MB" for one in seen), sep="\n")
    assert max(one.heap_mb for one in seen) < 200.0
    assert seen[-1].heap_mb - seen[0].heap_mb < 1.0


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def rss_mb(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
