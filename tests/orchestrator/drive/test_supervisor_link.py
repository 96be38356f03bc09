"""What orchestrator and supervisor say to each other arrives, and nobody waits for the other."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.orchestrator.drive.orchestrator_link import OrchestratorLink, linked
from foretwin.orchestrator.drive.supervision import (
    HandOver,
    Kill,
    Refusal,
    Running,
    Stop,
    TakeWork,
    ToldDeath,
)
from foretwin.orchestrator.drive.supervisor_link import SupervisorLink
from tests.orchestrator.trip import town_plan

COVERS = (
    "foretwin.orchestrator.drive.orchestrator_link",
    "foretwin.orchestrator.drive.supervision",
)

DIED = ToldDeath("w0", -9, True, 0.0, 5.0)


class Line:
    """Both ends of one line; `known` deaths are told already."""

    def __init__(self, folder: Path, *, known: int = 0) -> None:
        here, self.there = linked()
        self.plan = town_plan(folder)
        self.supervisor = OrchestratorLink(here)
        self.orchestrator = SupervisorLink(self.there, self.plan, deaths_known=known)

    def close(self) -> None:
        self.supervisor.close()
        self.there.close()


@pytest.fixture
def line(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Line]:
    line = Line(tmp_path, known=getattr(request, "param", 0))
    yield line
    line.close()


def test_each_death_is_told_once(line: Line) -> None:
    assert line.orchestrator.poll(0.0) == []
    line.supervisor.tell(Running({"w0": 7, "w1": 8}, 0, 0, [DIED]))
    (death,) = line.orchestrator.poll(0.0)
    assert (death.process_id, death.exit_code, death.row.when_dead) == ("w0", -9, "restart")
    later = ToldDeath("vehicle", 1, False, 0.0, 6.0)
    line.supervisor.tell(Running({"w1": 8}, 1, 0, [DIED, later]))
    line.supervisor.tell(Running({"w1": 8}, 1, 1, [later]))
    assert [one.process_id for one in line.orchestrator.poll(0.0)] == ["vehicle"]
    assert line.orchestrator.poll(0.0) == []
    assert (line.orchestrator.running(), line.orchestrator.restarted) == ({"w1": 8}, 1)


@pytest.mark.parametrize("line", [1], indirect=True)
def test_deaths_that_another_orchestrator_told_of_are_not_told_again(line: Line) -> None:
    line.supervisor.tell(Running({}, 1, 0, [DIED, ToldDeath("mirror", -11, True, 1.0, 5.0)]))
    assert [one.process_id for one in line.orchestrator.poll(0.0)] == ["mirror"]
    line.orchestrator.keep(b"standing")
    assert line.supervisor.hear() == [HandOver(2)]
    assert line.supervisor.standing == b"standing"


def test_a_standing_of_any_length_is_handed_over_and_the_last_one_counts(line: Line) -> None:
    line.there.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    long = bytes(range(256)) * 40_000
    line.orchestrator.keep(b"short")
    line.orchestrator.keep(long)
    assert line.supervisor.hear() == [HandOver(0), HandOver(0)]
    assert line.supervisor.standing == long
    assert not line.orchestrator.alone
    before = len(list(Path("/proc/self/fd").iterdir()))
    for number in range(50):
        line.orchestrator.keep(b"%d" % number)
        line.supervisor.hear()
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_what_the_orchestrator_says_arrives_in_order_and_news_alone(line: Line) -> None:
    line.orchestrator.kill("w1")
    line.orchestrator.let_give_way({"w0", "stranger"}, 0.0)
    line.orchestrator.let_give_way(["w0"], 1.0)
    line.orchestrator.refuse("no such map", by_user=True)
    assert line.supervisor.hear() == [
        Kill("w1"), TakeWork(["w0"]), Refusal("no such map", by_user=True),
    ]  # fmt: skip
    assert line.supervisor.hear() == []


def test_an_interruption_is_told_once_and_ends_the_drive(line: Line) -> None:
    assert not line.orchestrator.over
    line.supervisor.interrupt()
    line.supervisor.interrupt()
    line.orchestrator.poll(0.0)
    assert line.orchestrator.over
    assert line.orchestrator.start_again  # it would come back, and end


def test_the_end_is_waited_for(line: Line) -> None:
    line.supervisor.stopped(["viewer"])
    line.orchestrator.poll(0.0)
    line.supervisor.stopped(["w0"])
    assert line.orchestrator.stop(grace_s=0.0, but={"router"}) == ["w0"]
    assert line.supervisor.hear() == [Stop(0.0, ["router"])]


def test_without_a_supervisor_the_drive_ends_and_nothing_is_waited_for(line: Line) -> None:
    line.supervisor.tell(Running({"w0": 2**22 + 1}, 0, 0, []))
    line.orchestrator.poll(0.0)
    line.supervisor.close()
    assert not line.orchestrator.over
    line.orchestrator.poll(0.0)
    assert line.orchestrator.over
    assert not line.orchestrator.start_again
    line.orchestrator.keep(b"for nobody")
    assert line.orchestrator.stop(grace_s=0.0) == []


def test_a_supervisor_that_stands_still_holds_nobody_up(line: Line) -> None:
    line.there.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    for _ in range(10_000):
        line.orchestrator.keep(bytes(100))
    line.orchestrator.let_give_way(["w0"], 0.0)
    assert len(line.supervisor.hear()) < 10_000
    line.orchestrator.let_give_way(["w0"], 1.0)  # said again: nobody had heard it
    assert line.supervisor.hear()[-1] == TakeWork(["w0"])
    assert not line.orchestrator.over
