"""Who hangs and is killed, and that nobody is while the link to the router is away."""

from __future__ import annotations

import dataclasses
import datetime
import shutil
import signal
import threading
import time
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.refusal_counts import OwnRefusals, RefusalFile, RefusedKind
from foretwin.orchestrator.campaign.issuing import issue
from foretwin.orchestrator.drive.process_watch import (
    BACK_WITHIN_S,
    HUNG_AFTER_S,
    RECONNECT_S,
    RECOVERS_S,
    ROUTER_START_S,
    ProcessWatch,
)
from foretwin.orchestrator.drive.processes import PROCESSES
from foretwin.orchestrator.runner.memory import MemoryWatch
from foretwin.orchestrator.runner.supervisor import MAX_RESTARTS, Supervisor
from tests.orchestrator.campaign.campaigns import campaign, now
from tests.orchestrator.house import House
from tests.orchestrator.runner.test_supervisor import FakeChild, setup

EVERY_S = 0.1


class LinkedBus:
    """A bus whose link to the router comes and goes."""

    def __init__(self, bus: Any) -> None:
        self._bus, self.connected = bus, True

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)


class Watched:
    """A router and a worker under watch, ten times a second."""

    def __init__(self, folder: Path, **settings: Any) -> None:
        self.house = House(folder, **settings)
        self.bus = LinkedBus(self.house.bus)
        self.house.conductor.bus = self.bus
        self.children: dict[str, list[FakeChild]] = {}
        self.watch = ProcessWatch(Supervisor(self._launch))
        for name, process_id in (("router", "router"), ("w", "w0")):
            row = next(row for row in PROCESSES if row.name == name)
            self.watch.supervisor.start(row, setup(process_id))
        self.now_s = 0.0
        self.look(1.0)

    def _launch(self, *, module: str, setup: Any) -> FakeChild:
        self.children.setdefault(setup.process_id, []).append(FakeChild())
        return self.children[setup.process_id][-1]

    def look(self, seconds: float) -> None:
        until_s = self.now_s + seconds
        while self.now_s < until_s:
            self.now_s += EVERY_S
            self.watch.look_after(self.house.conductor, self.now_s)

    def alive(self, *process_ids: str) -> None:
        self.house.conductor.alive = dict.fromkeys(process_ids, self.now_s)

    def started(self, process_id: str) -> int:
        return len(self.children[process_id])


@pytest.fixture
def watched(tmp_path: Path) -> Watched:
    return Watched(tmp_path)


def test_who_falls_silent_is_killed_and_started_again(watched: Watched) -> None:
    watched.alive("w0")
    watched.look(RECONNECT_S + 0.5)
    watched.alive()
    watched.look(0.9 * HUNG_AFTER_S)
    assert watched.started("w0") == 1
    watched.look(0.5 * HUNG_AFTER_S)
    assert watched.started("w0") == 2


def test_the_token_of_a_dead_process_is_not_that_of_the_next_one(watched: Watched) -> None:
    """The bus may tell of the end after the system does: the next one has its time to start."""
    watched.alive("w0")
    watched.look(RECONNECT_S + 0.5)
    watched.children["w0"][0].exit_code = -9
    watched.look(2.0 * EVERY_S)
    assert watched.started("w0") == 2
    watched.house.conductor.process_down("w0")
    watched.look(10.0 * HUNG_AFTER_S)
    assert watched.started("w0") == 2


@pytest.mark.parametrize(("heard_after_s", "counts"), [(-EVERY_S, False), (1.0, True)])
def test_a_death_that_is_told_late_is_not_that_of_the_next_one(
    watched: Watched, heard_after_s: float, counts: bool
) -> None:
    """Who hears the successor before it is told of the death counts with it, and goes on to."""
    watched.look(RECONNECT_S + 0.5)
    watched.children["w0"][0].exit_code = -9
    watched.house.conductor.alive = {"w0": watched.now_s + heard_after_s}
    watched.look(2.0 * EVERY_S)
    assert watched.started("w0") == 2
    assert ("w0" in watched.house.conductor.alive) == counts


def test_the_end_waits_for_who_is_started_again_until_it_has_what_it_missed(
    watched: Watched,
) -> None:
    back = threading.Timer(0.3, watched.alive, ["recorder"])
    back.start()
    began_s = time.monotonic()
    watched.watch.wait_for("recorder", watched.house.conductor, stop=lambda: False)
    taken_s = time.monotonic() - began_s
    back.join()
    assert 0.3 + RECOVERS_S <= taken_s < BACK_WITHIN_S


@pytest.mark.parametrize("why", ["there", "given up", "told to end"])
def test_the_end_waits_for_nobody_who_does_not_come(watched: Watched, why: str) -> None:
    if why == "there":
        watched.alive("recorder")
    if why == "given up":
        watched.watch.given_up.add("recorder")
    began_s = time.monotonic()
    stop = why == "told to end"
    watched.watch.wait_for("recorder", watched.house.conductor, stop=lambda: stop)
    assert time.monotonic() - began_s < RECOVERS_S


def test_nobody_is_silent_while_the_link_is_away_and_a_little_longer(watched: Watched) -> None:
    watched.alive("w0")
    watched.look(RECONNECT_S + 0.5)
    watched.alive()
    watched.bus.connected = False
    watched.look(0.8 * HUNG_AFTER_S)
    watched.bus.connected = True
    watched.look(0.9 * (RECONNECT_S + HUNG_AFTER_S))
    watched.alive("w0")
    watched.look(30.0)
    assert (watched.started("w0"), watched.started("router")) == (1, 1)

    watched.alive()
    watched.look(2.0 * HUNG_AFTER_S)
    assert watched.started("w0") == 2, "it is watched again"


def test_a_router_without_a_link_is_killed_and_the_next_one_has_time_to_start(
    watched: Watched,
) -> None:
    watched.bus.connected = False
    watched.look(0.8 * HUNG_AFTER_S)
    assert watched.started("router") == 1
    watched.look(0.5 * HUNG_AFTER_S)
    assert watched.children["router"][0].signals == [signal.SIGKILL]
    assert watched.started("router") == 2
    watched.look(0.9 * ROUTER_START_S)
    assert watched.started("router") == 2
    watched.bus.connected = True
    watched.look(60.0)
    assert watched.started("router") == 2
    assert watched.watch.ended_by is None
    assert watched.watch.troubles == []


def test_a_router_that_dies_again_and_again_ends_the_drive(watched: Watched) -> None:
    for _ in range(MAX_RESTARTS + 1):
        assert watched.watch.ended_by is None
        watched.children["router"][-1].exit_code = -9
        watched.bus.connected = False
        before = watched.started("router")
        while watched.started("router") == before and watched.watch.ended_by is None:
            watched.look(EVERY_S)
    assert watched.watch.ended_by == "the router died again and again"
    assert watched.watch.troubles == ["router ended with code -9 and was not started again"]


def test_a_vehicle_that_is_gone_ends_the_drive_and_is_no_error_of_ours(tmp_path: Path) -> None:
    watched = Watched(tmp_path)
    row = next(row for row in PROCESSES if row.name == "vehicle")
    watched.watch.supervisor.start(row, setup("vehicle"))  # type: ignore[attr-defined]
    watched.look(1.0)
    assert not watched.watch.over
    watched.children["vehicle"][0].exit_code = -9
    watched.look(1.0)
    assert (watched.watch.over, watched.watch.ended_by) == (True, None)
    assert watched.started("vehicle") == 1
    assert watched.watch.troubles == [
        "vehicle ended with code -9: no telemetry comes any more, and the drive ends here"
    ]


def told(watched: Watched, text: str) -> int:
    return sum(text in event.text for event in watched.house.watched("event"))


def test_what_the_router_refuses_is_told_while_the_drive_goes_on(tmp_path: Path) -> None:
    watched = Watched(tmp_path)
    kind = RefusedKind(sender="viewer", reason="say", key="foretwin/v1/run/r/event", count=1)
    RefusalFile(watched.house.plan.processes_dir, "router").write(OwnRefusals(kinds=(kind,)))
    watched.look(3.0)
    assert told(watched, "refused: viewer may not say run/r/event") == 1


@pytest.mark.parametrize("there", [True, False])
def test_a_certificate_that_ends_soon_is_told_once(tmp_path: Path, there: bool) -> None:
    folder = campaign(tmp_path / "campaign", age_days=3.0)
    issue(folder, "worker", days=1, now=now() - datetime.timedelta(hours=23, minutes=55))
    if not there:
        shutil.rmtree(folder)
    watched = Watched(tmp_path / "drive")
    conductor = watched.house.conductor
    config = msgspec.structs.replace(conductor.plan.config, secure=str(folder))
    conductor.plan = dataclasses.replace(conductor.plan, config=config)
    watched.watch = ProcessWatch(watched.watch.supervisor)
    watched.look(3.0)
    assert told(watched, "a certificate of this drive ends") == there


def test_a_process_that_takes_too_much_memory_is_told_of_once(
    watched: Watched, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MemoryWatch, "_held_mb", lambda *_: 5000.0)
    monkeypatch.setattr(MemoryWatch, "_alone_mb", lambda *_: 5000.0)
    watched.look(30.0)
    assert told(watched, "w0 holds 5000 MB") == 1
