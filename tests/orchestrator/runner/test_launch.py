"""Fresh interpreters for the processes of a drive."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from foretwin.orchestrator.runner.launch import FreshInterpreter
from foretwin.orchestrator.runner.supervisor import Supervisor
from tests.contracts.bus_sides import DEADLINE_S
from tests.orchestrator.runner.test_supervisor import row, setup
from tests.system.foretwin_command import REPOSITORY


def test_fresh_interpreters_end_and_leave_nothing(tmp_path: Path) -> None:
    stubborn = tmp_path / "package" / "stubborn.py"
    stubborn.parent.mkdir()
    stubborn.write_text(
        "import signal, sys, time\n"
        "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "from foretwin.contracts.process_setup import parent_pid\n"
        "print(f'up, started by {parent_pid()}, then {parent_pid()}', flush=True)\n"
        "time.sleep(600)\n"
    )
    launch = FreshInterpreter(tmp_path, package="package")
    supervisor = Supervisor(launch)
    path = os.pathsep.join((str(tmp_path), str(REPOSITORY)))
    os.environ["PYTHONPATH"], before = path, os.environ.get("PYTHONPATH")
    try:
        supervisor.start(row("w")._replace(module="stubborn"), setup("w0"))
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before
    said = tmp_path / "w0.stderr"
    deadline = time.monotonic() + DEADLINE_S
    while "up" not in said.read_text() and time.monotonic() < deadline:
        assert list(supervisor.running()) == ["w0"]
        time.sleep(0.01)
    assert f"started by {os.getpid()}, then {os.getpid()}" in said.read_text()
    pid = supervisor.running()["w0"]
    assert supervisor.stop(grace_s=0.0, term_s=0.2) == ["w0"]
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
