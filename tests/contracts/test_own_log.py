"""What is written to this process's standard output is heard record by record, and nobody waits."""

from __future__ import annotations

import subprocess
import sys

from foretwin.contracts.own_log import _BURST, _LET_GO_S, _PER_S
from tests.pages import page

WRITES = """
import os, sys, time
from foretwin.contracts.own_log import OwnLog
heard, gaps = [], []
{prepare}
log = OwnLog({take}, lambda: gaps.append(len(heard)))
{write}
log.close()
os.write(1, b"after\\n")
print(heard[:4], len(heard), len(gaps), file=sys.stderr)
"""


def said(write: str, *, take: str = "heard.append", prepare: str = "") -> list[str]:
    code = WRITES.format(write=write, take=take, prepare=prepare)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout == ""
    assert done.returncode == 0, done.stderr
    return done.stderr.splitlines()


def test_the_page_tells_what_a_flood_is() -> None:
    flood = f"more than {_BURST:,} records at a stretch, or {_PER_S:,} a second"
    assert f"{flood}) they are let go for half a second" in page("bus.md")
    assert _LET_GO_S == 0.5


def test_each_write_is_a_record_whatever_stands_in_it() -> None:
    (line,) = said("os.write(1, b'one\\n'); os.write(1, b'two\\nthree\\n')")
    assert line == r"[b'one\n', b'two\nthree\n'] 2 0"


def test_the_rest_of_a_long_record_is_left_out() -> None:
    (line,) = said("os.write(1, b'x' * 60_000)", take="lambda one: heard.append(len(one))")
    assert line == "[1024] 1 0"


def test_who_writes_more_than_can_be_looked_at_does_not_wait() -> None:
    write = "for _ in range(60_000): os.write(1, b'x' * 300)"
    (line,) = said(write, take="lambda one: (heard.append(1), time.sleep(0.001))")
    count, gaps = map(int, line.split()[-2:])
    assert gaps >= 1
    assert count < 60_000


def test_an_error_of_ours_ends_the_hearing_and_not_the_writing() -> None:
    write = "for _ in range(60_000): os.write(1, b'x' * 300)"
    lines = said(write, take="lambda one: 1 / 0")
    assert lines[0].startswith("hears its own log no more")
    assert lines[-1] == "[] 0 0"
