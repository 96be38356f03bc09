"""Which processes of a drive are forks."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from foretwin.orchestrator.drive.launching import IMPORTED_HERE, launcher
from foretwin.orchestrator.drive.processes import PROCESSES
from foretwin.orchestrator.runner.fork_launch import Forks
from foretwin.orchestrator.runner.launch import FreshInterpreter
from tests.orchestrator.drive.test_in_charge import plan_with
from tests.orchestrator.trip import town_plan

STARTS_THREADS = {"viewer", "viewer.copilot", "telemetry.ros2"}
"""Rerun's, and those of a ROS 2 node."""


def test_each_process_has_what_it_imports_imported_or_must_not() -> None:
    others = {row.module for row in PROCESSES} - IMPORTED_HERE.keys()
    assert others == STARTS_THREADS | {"contracts.router"}


def test_all_that_is_imported_for_forks_starts_no_thread() -> None:
    names = sorted({name for names in IMPORTED_HERE.values() for name in names})
    script = (
        "import sys\n"
        "from importlib import import_module\n"
        "from pathlib import Path\n"
        "from foretwin.orchestrator.runner.warm_fork import trouble_with_forking\n"
        "for name in ('orchestrator.drive.drive', *sys.argv[1:]):\n"
        "    import_module(f'foretwin.{name}')\n"
        "print(trouble_with_forking())\n"
        "tasks = Path('/proc/self/task').glob('*/comm')\n"
        "print(len([task for task in tasks if task.read_text() != 'jemalloc_bg_thd\\n']))"
    )
    words = [sys.executable, "-P", "-c", script, *names]
    alone = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    said = subprocess.run(words, capture_output=True, text=True, check=True, env=alone)
    # A thread of a library may have no name of its own: all are counted.
    assert said.stdout == "None\n1\n"


def test_where_linear_algebra_has_threads_nobody_is_a_fork(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = town_plan(tmp_path)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    assert isinstance(launcher(plan), FreshInterpreter)
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    assert isinstance(launcher(plan), FreshInterpreter)


def test_the_command_has_no_threads_of_linear_algebra() -> None:
    script = (
        "import os, sys\n"
        "import foretwin.orchestrator.commands.cli as cli\n"
        "from foretwin.__main__ import main\n"
        "cli.run = lambda words: print(os.environ['OPENBLAS_NUM_THREADS'])\n"
        "main()"
    )
    others = os.environ | {"OPENBLAS_NUM_THREADS": "2"}
    words = [sys.executable, "-P", "-c", script]
    said = subprocess.run(words, capture_output=True, text=True, check=True, env=others)
    assert said.stdout == "1\n"


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Libraries of linear algebra are without threads, as the command has them."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")


@pytest.mark.usefixtures("alone")
def test_a_drive_imports_for_its_processes_alone(tmp_path: Path) -> None:
    launch = launcher(town_plan(tmp_path))
    assert isinstance(launch, Forks)
    assert "sim_worker.worker" in launch.imported
    assert "sim_worker.sensors.process" not in launch.imported
    assert launch.fresh == {"contracts.router"}


@pytest.mark.usefixtures("alone")
def test_no_process_has_the_key_of_orders_towards_a_vehicle(tmp_path: Path) -> None:
    plan = plan_with(tmp_path, enabled=True, flag=True)
    assert isinstance(launcher(plan), FreshInterpreter)
    assert isinstance(launcher(plan_with(tmp_path, enabled=True, flag=False)), Forks)
