"""A program of others ends with the process that started it, also where that is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from foretwin.contracts.ends_with_parent import ends_with_parent
from tests.system.foretwin_command import is_running, wait_for

STARTS = """
import os, subprocess, sys, time
from foretwin.contracts.ends_with_parent import ends_with_parent
sleeps = [sys.executable, "-c", "import time; print('begun', flush=True); time.sleep(600)"]
child = subprocess.Popen(ends_with_parent(sleeps, parent=os.getpid()), stdout=subprocess.PIPE)
child.stdout.readline()
print(child.pid, flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux can do that")
def test_it_ends_with_a_parent_that_is_killed() -> None:
    parent = subprocess.Popen([sys.executable, "-c", STARTS], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    assert is_running(child)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    wait_for(lambda: not is_running(child), "the end of its child")


def test_it_is_the_program_itself_with_its_arguments_and_exit_code() -> None:
    program = [sys.executable, "-c", "import sys; sys.exit(len(sys.argv[1]))", "seven c"]
    child = subprocess.Popen(ends_with_parent(program, parent=os.getpid()))
    assert child.wait() == 7


def test_it_does_not_begin_where_the_parent_is_gone_already() -> None:
    child = subprocess.Popen(
        ends_with_parent([sys.executable, "-c", "print('begun')"], parent=1),
        stdout=subprocess.PIPE,
    )
    assert child.communicate() == (b"", None)
