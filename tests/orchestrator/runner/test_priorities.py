"""Who gives way: the niceness of a session's processes and threads, and of the session itself."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.orchestrator.runner.priorities import gives_way

WAITS = """
import threading
threading.Thread(target=threading.Event().wait, daemon=True).start()
print("up", flush=True)
input()
"""


@pytest.fixture(params=[True, False], ids=["leads its session", "in this session"])
def child(request: pytest.FixtureRequest) -> Iterator[subprocess.Popen[bytes]]:
    started = subprocess.Popen(
        [sys.executable, "-c", WAITS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=request.param,
    )
    assert started.stdout is not None
    assert started.stdout.readline() == b"up\n"
    yield started
    started.communicate(b"\n", timeout=60.0)


def test_it_gets_its_niceness_and_its_session_too(
    child: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    (tmp_path / str(child.pid)).mkdir()
    session = tmp_path / str(child.pid) / "autogroup"
    most = max(12, os.getpriority(os.PRIO_PROCESS, 0))
    assert gives_way(child.pid, most, processes=tmp_path)
    assert os.getpriority(os.PRIO_PROCESS, child.pid) == most
    leads = os.getsid(child.pid) == child.pid
    assert session.exists() == leads
    if leads:
        assert session.read_text() == f"{most}\n"
        threads = Path(f"/proc/{child.pid}/task")
        ids = [int(one.name) for one in threads.iterdir()] if threads.exists() else [child.pid]
        assert {os.getpriority(os.PRIO_PROCESS, one) for one in ids} == {most}
    assert os.getpriority(os.PRIO_PROCESS, 0) <= most, "nobody else was asked"


def test_what_the_kernel_puts_off_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def busy(*_: object, **__: object) -> int:
        raise BlockingIOError("one such change every 100 ms")

    child = subprocess.Popen(
        [sys.executable, "-c", "input()"], stdin=subprocess.PIPE, start_new_session=True
    )
    try:
        monkeypatch.setattr(Path, "write_text", busy)
        assert not gives_way(child.pid, 19)
    finally:
        child.communicate(b"\n", timeout=60.0)


def test_a_process_that_is_gone_is_left_alone() -> None:
    child = subprocess.Popen([sys.executable, "-c", ""], start_new_session=True)
    child.wait(timeout=60.0)
    assert gives_way(child.pid, 19)
