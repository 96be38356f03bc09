"""Spans of several processes become one trace; what is off leaves nothing and costs nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
import timeit
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts import trace
from tests.pages import page

ANOTHER = """
import sys
from pathlib import Path
from foretwin.contracts import trace
trace.begin(Path(sys.argv[1]), "w0")
with trace.span("job"):
    trace.came("job", "abc")
trace.end()
"""


@pytest.fixture(autouse=True)
def _ended() -> Iterator[None]:
    yield
    trace.end()


def read(file: Path) -> list[dict[str, Any]]:
    """Return the events of a trace."""
    found: list[dict[str, Any]] = json.loads(file.read_bytes())["traceEvents"]
    return found


def by_name(events: list[dict[str, Any]], name: str) -> dict[str, Any]:
    (found,) = (event for event in events if event["name"] == name)
    return found


def recorded(tmp_path: Path) -> list[dict[str, Any]]:
    """End the trace of this process and return all events."""
    trace.end()
    trace.joined(tmp_path / "parts", tmp_path / "trace.json")
    return read(tmp_path / "trace.json")


def burn(seconds: float) -> None:
    until_s = time.thread_time() + seconds
    while time.thread_time() < until_s:
        pass


def test_a_span_has_its_time_its_cpu_time_and_its_place_within_others(tmp_path: Path) -> None:
    trace.begin(tmp_path / "parts", "orchestrator")
    before_us = time.monotonic_ns() / 1e3
    with trace.span("round", futures=64):
        with trace.span("waits"):
            threading.Event().wait(0.02)
        with trace.span("works"):
            burn(0.01)
    events = recorded(tmp_path)

    outer, waits, works = (by_name(events, name) for name in ("round", "waits", "works"))
    assert outer["args"]["futures"] == 64
    assert outer["pid"] == os.getpid()
    assert outer["ts"] >= before_us
    for inner in (waits, works):
        assert outer["ts"] <= inner["ts"]
        assert inner["ts"] + inner["dur"] <= outer["ts"] + outer["dur"] + 0.01
    assert waits["dur"] >= 20e3 > 10e3 > waits["tdur"]
    assert works["dur"] + 100.0 >= works["tdur"] >= 10e3 - 100.0
    assert works["args"][trace.READY_MS] >= 0.0
    assert by_name(events, "process_name")["args"] == {"name": "orchestrator"}


def test_where_the_kernel_does_not_say_what_a_thread_waited_for_it_waited_for_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as without_proc:
        without_proc.setattr(os, "open", refuse)
        thread = trace._Thread()
    monkeypatch.setattr(trace, "_thread", thread)
    trace.begin(tmp_path / "parts", "orchestrator")
    with trace.span("works"):
        burn(0.001)
    assert by_name(recorded(tmp_path), "works")["args"] == {trace.READY_MS: 0.0}


def refuse(*_: object) -> int:
    raise FileNotFoundError("no /proc here")


def test_a_short_span_does_not_tell_what_it_waited_for(tmp_path: Path) -> None:
    trace.begin(tmp_path / "parts", "orchestrator")
    with trace.span("nothing"):
        pass
    assert trace._TOLD_FROM_NS == 500_000
    told = by_name(recorded(tmp_path), "nothing")
    # A machine that puts the thread aside in between makes the span long.
    assert told["args"] == {} or told["dur"] >= 500.0


def test_what_is_off_records_nothing(tmp_path: Path) -> None:
    with trace.span("before"):
        trace.since("waited", 0)
    trace.sent("job", "abc")
    trace.begin(tmp_path / "parts", "orchestrator")
    events = recorded(tmp_path)
    with trace.span("after"):
        pass

    assert [event["name"] for event in events] == ["process_name"]


def test_what_is_off_costs_next_to_nothing() -> None:
    def spanned() -> None:
        with trace.span("nothing", id=1):
            pass

    each_s = min(timeit.repeat(spanned, number=1000, repeat=50)) / 1000
    assert each_s < 5e-6


def test_a_decorated_function_is_a_span_and_answers_as_before(tmp_path: Path) -> None:
    @trace.traced("add")
    def add(one: int, *, two: int) -> int:
        return one + two

    assert (add(1, two=2), add.__name__) == (3, "add")
    trace.begin(tmp_path / "parts", "orchestrator")
    assert add(2, two=3) == 5
    assert by_name(recorded(tmp_path), "add")["ph"] == "X"


def test_an_error_within_a_span_goes_on_and_the_span_ends(tmp_path: Path) -> None:
    trace.begin(tmp_path / "parts", "orchestrator")
    with pytest.raises(ValueError, match="of ours"), trace.span("fails"):
        raise ValueError("of ours")
    assert by_name(recorded(tmp_path), "fails")["dur"] >= 0.0


def test_waiting_reaches_back_to_when_it_began(tmp_path: Path) -> None:
    trace.begin(tmp_path / "parts", "orchestrator")
    began_ns = time.monotonic_ns() - 5_000_000
    trace.since("in the queue", began_ns, channel="job")
    begun, ended = (e for e in recorded(tmp_path) if e["name"] == "in the queue")

    assert (begun["ph"], ended["ph"]) == ("b", "e")
    assert begun["id2"] == ended["id2"]
    assert begun["ts"] == pytest.approx(began_ns / 1e3)
    assert ended["ts"] - begun["ts"] >= 5000.0
    assert begun["args"] == {"channel": "job"}


def test_two_processes_have_one_clock_and_an_arrow_between_them(tmp_path: Path) -> None:
    trace.begin(tmp_path / "parts", "orchestrator")
    with trace.span("give jobs out"):
        trace.sent("job", "abc")
    subprocess.run([sys.executable, "-c", ANOTHER, str(tmp_path / "parts")], check=True)
    with trace.span("after it"):
        pass
    events = recorded(tmp_path)

    given, job, after = (by_name([e for e in events if e["ph"] == "X"], name) for name in
                         ("give jobs out", "job", "after it"))  # fmt: skip
    assert given["ts"] < job["ts"] < job["ts"] + job["dur"] < after["ts"]
    start, end = (next(e for e in events if e["ph"] == kind) for kind in "sf")
    assert (start["pid"], end["pid"]) == (given["pid"], job["pid"])
    assert given["pid"] != job["pid"]
    assert start["id"] == end["id"]
    assert job["ts"] <= end["ts"] <= job["ts"] + job["dur"]
    assert not (tmp_path / "parts").exists()


OFTEN = """
import sys
from pathlib import Path
from foretwin.contracts import trace
trace.MOST_BYTES = 100_000
trace.begin(Path(sys.argv[1]), "orchestrator")
for _ in range(3000):
    with trace.span("often"):
        pass
trace.end()
"""
"""In a process of its own: threads that other tests left add spans to a trace of this one."""


def test_the_page_tells_how_much_a_process_writes() -> None:
    assert f"A process writes {trace.MOST_BYTES / 1e6:g} MB at most" in page("trace.md")


def test_a_process_writes_no_more_than_it_may(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", OFTEN, str(tmp_path / "parts")], check=True)
    trace.joined(tmp_path / "parts", tmp_path / "trace.json")
    events = read(tmp_path / "trace.json")

    written = sum(event["name"] == "often" for event in events)
    left_out = by_name(events, "process_labels")["args"]["labels"]
    assert left_out == f"{3000 - written} spans left out"
    assert 100_000 < (tmp_path / "trace.json").stat().st_size < 200_000


def test_a_killed_process_leaves_its_whole_lines(tmp_path: Path) -> None:
    parts = tmp_path / "parts"
    parts.mkdir()
    whole = b'{"ph":"X","name":"whole","ts":1.0}\n'
    (parts / "w0-1.trace").write_bytes(whole + whole[:20])
    (parts / "w0-2.trace").write_bytes(whole)

    assert trace.joined(parts, tmp_path / "trace.json") == 2
    assert [event["name"] for event in read(tmp_path / "trace.json")] == ["whole", "whole"]


def test_threads_that_ended_leave_nothing_open(tmp_path: Path) -> None:
    trace.begin(tmp_path / "parts", "w0")

    def work() -> None:
        with trace.span("job"):
            pass

    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(20):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_a_whole_run_is_recorded_and_joined_at_its_end(tmp_path: Path) -> None:
    with trace.whole_run(tmp_path / trace.TRACE_PARTS, "orchestrator"), trace.span("round"):
        pass
    assert {event["name"] for event in read(tmp_path / trace.TRACE)} == {"process_name", "round"}
    with trace.whole_run(None, "orchestrator"), trace.span("round"):
        pass
    assert [file.name for file in tmp_path.iterdir()] == [trace.TRACE]
