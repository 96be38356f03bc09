"""Rerun as a server for browsers: it ends with the viewer, whatever ends that."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from tests.system.foretwin_command import is_running, wait_for

VIEWER = """
import threading, time
from foretwin.viewer import live_viewer
started, start_program = [], live_viewer.start_program
def start(*arguments, **given):
    started.append(start_program(*arguments, **given))
    return started[-1]
live_viewer.start_program = start
view = live_viewer.live_viewer("web")
def show():
    view.open()
    print(started[0].pid, flush=True)
    time.sleep(600)
threading.Thread(target=show, daemon=True).start()
time.sleep(600)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux can do that")
def test_the_server_of_a_killed_viewer_ends() -> None:
    viewer = subprocess.Popen(
        [sys.executable, "-P", "-c", VIEWER], stdout=subprocess.PIPE, text=True
    )
    assert viewer.stdout is not None
    server = int(viewer.stdout.readline())
    assert is_running(server)
    viewer.send_signal(signal.SIGKILL)
    viewer.wait()
    viewer.stdout.close()
    wait_for(lambda: not is_running(server), "the end of the server")
