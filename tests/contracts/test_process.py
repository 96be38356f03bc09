"""A process of a run leaves when it should, and says in the log why it ended otherwise."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts import trace
from foretwin.contracts.bus import Alive, Mailbox, ZenohBus
from foretwin.contracts.cpu_use import cpu_uses
from foretwin.contracts.keys import alive_key, key
from foretwin.contracts.mailbox import Received
from foretwin.contracts.one_heap import FreeMemory
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.process import ProcessLife, hold, is_held
from foretwin.contracts.process_setup import STARTED_BY, setup_given
from foretwin.contracts.setup import BusSetup, ProcessSetup, write_setup
from foretwin.contracts.simulation import RunEnd
from tests.contracts.bus_sides import DEADLINE_S, take
from tests.contracts.memory_bus import MemoryBus

RUN = {"run": "r1"}

WAITER = """
import time
from foretwin.contracts.process import run_process
from foretwin.contracts.setup import ProcessSetup

def serve(setup, bus, life):
    life.ready()
    while not life.over:
        life.terminated.wait(0.02)

run_process(ProcessSetup, serve)
"""

FAILER = """
from foretwin.contracts.process import run_process
from foretwin.contracts.setup import ProcessSetup

def serve(setup, bus, life):
    raise RuntimeError("the wheels came off")

run_process(ProcessSetup, serve)
"""


class Run:
    """A bus with the orchestrator on it, and the setup of one process `p0`."""

    def __init__(self, folder: Path) -> None:
        self.setup = ProcessSetup(
            run_id="r1",
            process_id="p0",
            vehicle_id="ego",
            bus=BusSetup(endpoint=free_endpoint()),
            log_file=str(folder / "log.jsonl"),
            grace_s=1.0,
        )
        self._file = folder / "p0.json"
        write_setup(self.setup, self._file)
        self.bus = ZenohBus(self.setup.bus, router=True)
        self.alive = Mailbox(10)
        self.bus.watch_alive(alive_key(process="p0", **RUN), self.alive)
        self.bus.declare_alive(alive_key(process="orchestrator", **RUN))

    @contextmanager
    def process(self, code: str) -> Iterator[subprocess.Popen[bytes]]:
        with subprocess.Popen([sys.executable, "-c", code, "--setup", str(self._file)]) as process:
            try:
                yield process
            finally:
                process.kill()

    def log(self) -> list[dict[str, object]]:
        return [json.loads(line) for line in Path(self.setup.log_file).read_text().splitlines()]


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    one = Run(tmp_path)
    yield one
    one.bus.close()


def test_it_leaves_when_the_run_ends(run: Run) -> None:
    with run.process(WAITER) as process:
        up = take(run.alive)
        run.bus.publish("run_end", RunEnd(stamp_ns=0), **RUN)

        assert process.wait(DEADLINE_S) == 0
        assert isinstance(up, Alive)
        assert not take(run.alive).up


def test_it_leaves_on_sigterm(run: Run) -> None:
    with run.process(WAITER) as process:
        take(run.alive)
        process.terminate()

        assert process.wait(DEADLINE_S) == 0


def test_it_leaves_when_the_orchestrator_is_gone(run: Run) -> None:
    with run.process(WAITER) as process:
        take(run.alive)
        run.bus.close()

        assert process.wait(DEADLINE_S) == 0


def test_ctrl_c_is_left_to_the_orchestrator(run: Run) -> None:
    with run.process(WAITER) as process:
        take(run.alive)
        process.send_signal(2)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.5)
        run.bus.publish("run_end", RunEnd(stamp_ns=0), **RUN)

        assert process.wait(DEADLINE_S) == 0


def test_an_error_ends_it_with_code_1_and_stands_in_the_log(run: Run) -> None:
    with run.process(FAILER) as process:
        assert process.wait(DEADLINE_S) == 1

    (line,) = run.log()
    assert line["process"] == "p0"
    assert line["level"] == "error"
    assert "the wheels came off" in str(line["traceback"])


def test_what_is_wrong_outside_ends_it_with_code_2_in_one_line(run: Run) -> None:
    wrong = FAILER.replace("RuntimeError", "FileNotFoundError")
    command = [sys.executable, "-c", wrong, "--setup", str(run._file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S)
    assert (done.returncode, done.stderr) == (2, "p0: the wheels came off\n")
    assert run.log()[-1]["text"] == "the wheels came off"


def test_it_leaves_what_it_took_and_what_it_did(run: Run, tmp_path: Path) -> None:
    run.setup = msgspec.structs.replace(run.setup, trace_dir=str(tmp_path / "parts"))
    write_setup(run.setup, run._file)
    with run.process(WAITER) as process:
        take(run.alive)
        assert is_held(run._file)
        process.terminate()
        assert process.wait(DEADLINE_S) == 0
    (use,) = cpu_uses(tmp_path).values()
    assert 0.0 < use.starting_cpu_s <= use.cpu_s
    assert use.share_of_core is not None
    trace.joined(tmp_path / "parts", tmp_path / "trace.json")
    assert b'"p0"' in (tmp_path / "trace.json").read_bytes()
    assert not is_held(run._file)


class Noted:
    """A meter, or a file of refusals, that notes what it is asked."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def ready(self) -> None:
        self.asked.append("ready")

    def look(self, *_: object) -> None:
        self.asked.append("look")


def test_what_it_takes_and_refuses_is_looked_at_whenever_it_asks_for_its_run() -> None:
    setup = ProcessSetup(
        run_id="r1", process_id="p0", vehicle_id="ego", bus=BusSetup(endpoint=""), log_file=""
    )
    meter, refusals = Noted(), Noted()
    life = ProcessLife(setup, MemoryBus(), meter=meter, refusal_file=refusals)  # type: ignore[arg-type]
    life.ready()
    assert not life.over
    assert not life.begun
    assert meter.asked == ["ready", "look", "look"]
    assert refusals.asked == ["look", "look"]
    ProcessLife(setup, MemoryBus()).ready()


def test_it_gives_free_memory_back_while_it_asks_for_its_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looked: list[float] = []
    monkeypatch.setattr(FreeMemory, "look", lambda _, now_s: looked.append(now_s))
    setup = ProcessSetup(
        run_id="r1", process_id="p0", vehicle_id="ego", bus=BusSetup(endpoint=""), log_file=""
    )
    life = ProcessLife(setup, MemoryBus(), mono_s=lambda: 7.0)
    assert not life.over
    assert looked == [7.0]


def test_it_waits_out_the_grace_once_the_orchestrator_is_gone() -> None:
    orchestrator = alive_key(process="orchestrator", **RUN)
    setup = ProcessSetup(
        run_id="r1", process_id="p0", vehicle_id="ego", bus=BusSetup(endpoint=""), log_file=""
    )
    bus, now_s = MemoryBus(), 100.0
    bus.declare_alive(orchestrator)
    life = ProcessLife(setup, bus, mono_s=lambda: now_s)
    assert not life.over

    bus.lose(orchestrator)
    assert not life.over
    now_s += setup.grace_s
    assert not life.over
    now_s += 0.1
    assert life.over


def test_it_has_begun_once_the_orchestrator_was_there_and_none_that_never_was_is_gone() -> None:
    orchestrator = alive_key(process="orchestrator", **RUN)
    setup = ProcessSetup(
        run_id="r1", process_id="p0", vehicle_id="ego", bus=BusSetup(endpoint=""), log_file=""
    )
    bus, now_s = MemoryBus(), 100.0
    life = ProcessLife(setup, bus, mono_s=lambda: now_s)
    bus.lose(orchestrator)
    now_s += 1000.0
    assert (life.begun, life.over, life.run_ended) == (False, False, False)
    bus.declare_alive(orchestrator)
    assert (life.begun, life.over) == (True, False)
    bus.lose(orchestrator)
    assert not life.over
    bus.declare_alive(orchestrator)  # there again in time
    now_s += 1000.0
    assert not life.over


def test_a_process_holds_its_setup_as_long_as_it_lives(tmp_path: Path) -> None:
    file = tmp_path / "p0.json"
    file.touch()
    assert not is_held(file)
    holds = hold(file)
    assert is_held(file)
    assert is_held(file), "asking changes nothing"
    os.close(holds)
    assert not is_held(file)


def test_whose_starter_has_died_before_it_could_ask_for_it_leaves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = ProcessSetup(
        run_id="r1", process_id="p0", vehicle_id="ego", bus=BusSetup(endpoint="none"),
        log_file=str(tmp_path / "log.jsonl"),
    )  # fmt: skip
    monkeypatch.setenv(STARTED_BY, f"{os.getppid()}")
    assert not ProcessLife(setup, MemoryBus()).over
    monkeypatch.setenv(STARTED_BY, f"{os.getpid()}")  # as good as any that is not its parent
    assert ProcessLife(setup, MemoryBus()).over
    assert STARTED_BY not in os.environ, "what it starts itself has another parent"
    assert not ProcessLife(setup, MemoryBus()).over


def test_bytes_that_are_no_end_of_a_run_end_nothing(tmp_path: Path) -> None:
    bus = MemoryBus()
    setup = ProcessSetup(
        run_id="r1", process_id="p0", vehicle_id="ego", bus=BusSetup(endpoint="none"),
        log_file=str(tmp_path / "log.jsonl"),
    )  # fmt: skip
    life = ProcessLife(setup, bus)
    for _, channel, mailbox in bus._subscribers:
        assert channel == "run_end"
        for on in (key("run_end", run="r1"), "**"):
            mailbox.put(Received("run_end", on, b"hello", RunEnd))
    assert not life.over

    bus.publish("run_end", RunEnd(stamp_ns=0), **RUN)
    assert life.over
    assert life.run_ended


@pytest.mark.parametrize(
    ("text", "why"), [(None, "No such file or directory"), ("{", "truncated"), ("{}", "missing")]
)
def test_a_setup_that_cannot_be_read_is_told_in_one_line(
    text: str | None, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "p0.json"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    with pytest.raises(SystemExit) as left:
        setup_given(ProcessSetup, ["--setup", str(file)])
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{file}: ")
    assert why in line
