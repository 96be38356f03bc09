"""SIGTERM and SIGHUP are one; nohup is respected."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from foretwin.contracts.end_signals import END_SIGNALS, ignore_end_signals, on_end_signals
from tests.contracts.bus_sides import DEADLINE_S


@pytest.fixture(autouse=True)
def _as_it_was() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in END_SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_each_of_them_is_taken(number: signal.Signals) -> None:
    taken: list[str] = []
    on_end_signals(lambda: taken.append("asked"))
    os.kill(os.getpid(), number)

    assert taken == ["asked"]


def test_under_nohup_a_closed_terminal_ends_nothing() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    taken: list[str] = []
    on_end_signals(lambda: taken.append("asked"))
    os.kill(os.getpid(), signal.SIGHUP)
    assert taken == []

    os.kill(os.getpid(), signal.SIGTERM)
    assert taken == ["asked"]


SAYS_THAT_IT_ENDS = """
import signal, sys
from foretwin.contracts.end_signals import on_end_signals
asked = []
on_end_signals(lambda: asked.append(1))
sys.stdin.readline()
print("said to a terminal that is gone", flush=True)
print("and where errors go", file=sys.stderr, flush=True)
sys.exit(7 + len(asked))
"""


def test_words_to_a_terminal_that_is_gone_go_nowhere() -> None:
    ours, theirs = os.openpty()
    with subprocess.Popen(
        [sys.executable, "-c", SAYS_THAT_IT_ENDS], stdin=subprocess.PIPE, stdout=theirs,
        stderr=theirs, start_new_session=True,
    ) as process:  # fmt: skip
        os.close(theirs)
        os.close(ours)
        deadline_s = time.monotonic() + DEADLINE_S
        while not takes(process.pid, signal.SIGHUP):
            assert time.monotonic() < deadline_s
        process.send_signal(signal.SIGHUP)
        assert process.stdin is not None
        process.stdin.write(b"\n")
        process.stdin.close()
        assert process.wait(DEADLINE_S) == 7 + 1, "asked once, and no word was an error"


def takes(pid: int, number: int) -> bool:
    """Whether a process has said by now that it takes a signal."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    (caught,) = (line.split()[1] for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(int(caught, 16) >> number - 1 & 1)


def test_who_ends_already_is_not_asked_again() -> None:
    taken: list[str] = []
    on_end_signals(lambda: taken.append("asked"))
    ignore_end_signals()
    for number in END_SIGNALS:
        os.kill(os.getpid(), number)

    assert taken == []
