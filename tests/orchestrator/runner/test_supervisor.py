"""The supervisor: who died, who is started again, and that nothing is left."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace as Namespace

import pytest

from foretwin.contracts.setup import BusSetup, ProcessSetup
from foretwin.orchestrator.drive.processes import PROCESSES, ProcessRow, row_of
from foretwin.orchestrator.runner import supervisor
from foretwin.orchestrator.runner.supervisor import (
    MAX_RESTARTS,
    Supervisor,
    fold_stderr,
)


class FakeChild:
    def __init__(self) -> None:
        self.pid = 2**22 + 1  # beyond any real process
        self.exit_code: int | None = None
        self.signals: list[int] = []

    def poll(self) -> int | None:
        return self.exit_code

    def send_signal(self, sig: int) -> None:
        self.signals.append(sig)
        if sig in (signal.SIGTERM, signal.SIGKILL):
            self.exit_code = -sig

    def wait(self, timeout: float | None = None) -> int:
        return self.exit_code or 0


def setup(process_id: str) -> ProcessSetup:
    return ProcessSetup(
        run_id="r", process_id=process_id, vehicle_id="ego",
        bus=BusSetup(endpoint="tcp/127.0.0.1:1"), log_file=os.devnull,
    )  # fmt: skip


def row(name: str) -> ProcessRow:
    return next(r for r in PROCESSES if r.name == name)


def supervised() -> tuple[Supervisor, list[FakeChild]]:
    children: list[FakeChild] = []

    def launch(*, module: str, setup: ProcessSetup) -> FakeChild:
        children.append(FakeChild())
        return children[-1]

    return Supervisor(launch), children


def test_a_dead_worker_is_started_again_and_a_dead_vehicle_reported() -> None:
    supervisor, children = supervised()
    supervisor.start(row("w"), setup("w0"))
    supervisor.start(row("vehicle"), setup("vehicle"))
    children[0].exit_code = -9
    children[1].exit_code = 1
    deaths = supervisor.poll(0.0)
    assert [(d.process_id, d.exit_code, d.restarted) for d in deaths] == [
        ("w0", -9, True),
        ("vehicle", 1, False),
    ]
    assert (len(children), supervisor.restarted) == (3, 1)
    assert supervisor.poll(0.1) == []


def test_who_writes_for_later_gives_way() -> None:
    nice = {r.name: r.nice for r in PROCESSES}
    assert nice["w"] == nice["recorder"] == nice["vehicle"] == 0
    assert nice["viewer"] == nice["tuning"] > 0
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        supervisor = Supervisor(lambda *, module, setup: child)
        supervisor.start(row("viewer"), setup("viewer"))
        supervisor.let_give_way({"w0"}, 0.0)
        before = os.getpriority(os.PRIO_PROCESS, child.pid)
        assert before == os.getpriority(os.PRIO_PROCESS, 0), "it is still waited for"
        supervisor.let_give_way({"w0", "viewer"}, 0.1)
        assert os.getpriority(os.PRIO_PROCESS, child.pid) >= nice["viewer"]
    finally:
        child.communicate(b"\n")


def test_who_watches_and_records_is_started_again_but_not_in_lock_step() -> None:
    live, stepped = (Namespace(config=Namespace(lock_step=step)) for step in (False, True))
    watching = [row(name) for name in ("tuning", "sensors", "recorder", "viewer", "copilot")]
    assert {row_of(one, live).when_dead for one in watching} == {"restart"}  # type: ignore[arg-type]
    assert {row_of(one, stepped).when_dead for one in watching} == {"report"}  # type: ignore[arg-type]
    assert row_of(row("router"), live).when_dead == "restart"  # type: ignore[arg-type]
    assert row_of(row("router"), stepped).when_dead == "end_drive"  # type: ignore[arg-type]
    others = [one for one in PROCESSES if one not in (*watching, row("router"))]
    in_turn = [one._replace(nice=0) for one in others]  # all are waited for
    assert [row_of(one, stepped) for one in others] == in_turn  # type: ignore[arg-type]


def test_who_keeps_dying_is_started_after_pauses_that_grow_and_then_given_up() -> None:
    supervisor, children = supervised()
    supervisor.start(row("recorder"), setup("recorder"))
    now_s, pauses = 0.0, []
    for _ in range(MAX_RESTARTS):
        children[-1].exit_code = 1
        (death,) = supervisor.poll(now_s)
        assert death.restarted
        assert supervisor.poll(now_s + 0.9 * death.pause_s) == [], "told once"
        assert (len(children) == supervisor.restarted + 1) is True
        now_s += death.pause_s
        assert supervisor.poll(now_s) == []
        assert list(supervisor.running()) == ["recorder"]
        pauses.append(death.pause_s)
    assert pauses == [0.0, 1.0, 2.0, 4.0, 8.0]
    assert supervisor.restarted == MAX_RESTARTS
    children[-1].exit_code = 1
    (death,) = supervisor.poll(now_s)
    assert not death.restarted
    assert supervisor.poll(now_s + 100.0) == []
    assert supervisor.running() == {}


def test_who_cannot_be_started_now_is_started_later() -> None:
    """A machine without memory, or a full disk, ends no supervisor."""
    children, troubles = [FakeChild(), FakeChild()], iter([None, OSError(12, "no memory"), None])

    def launch(*, module: str, setup: ProcessSetup) -> FakeChild:
        if (trouble := next(troubles)) is not None:
            raise trouble
        return children[supervisor.started + supervisor.restarted]

    supervisor = Supervisor(launch)
    supervisor.start(row("recorder"), setup("recorder"))
    children[0].exit_code = -9
    (death,) = supervisor.poll(1.0)
    assert death.restarted
    assert supervisor.poll(1.5) == []
    assert (supervisor.running(), supervisor.restarted) == ({}, 0)
    assert supervisor.poll(2.0) == []
    assert (list(supervisor.running()), supervisor.restarted) == (["recorder"], 1)


def test_a_death_long_ago_is_forgotten() -> None:
    supervisor, children = supervised()
    supervisor.start(row("viewer"), setup("viewer"))
    for day in range(2 * MAX_RESTARTS):
        children[-1].exit_code = -9
        (death,) = supervisor.poll(day * 86_400.0)
        assert (death.restarted, death.pause_s) == (True, 0.0)


def test_what_a_process_said_last_lands_in_the_log(tmp_path: Path) -> None:
    (tmp_path / "w0.stderr").write_text("Traceback\n\nKeyError: 3\n")
    log_file = tmp_path / "log.jsonl"
    fold_stderr(tmp_path, log_file)
    lines = [json.loads(line) for line in log_file.read_text().splitlines()]
    assert [line["text"] for line in lines] == ["Traceback", "KeyError: 3"]
    assert not list(tmp_path.glob("*.stderr"))


def test_of_a_process_that_says_too_much_the_end_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "MOST_STDERR_BYTES", 9)
    (tmp_path / "w0.stderr").write_text("too much\nat last\n")
    fold_stderr(tmp_path, tmp_path / "log.jsonl")
    (line,) = map(json.loads, (tmp_path / "log.jsonl").read_text().splitlines())
    assert line["text"] == "at last"
