"""Starts one process of a drive, as a fresh interpreter; `fork_launch` starts it as a fork."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Protocol

from foretwin.contracts.process_setup import STARTED_BY, ProcessSetup, write_setup

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""What tells libraries of linear algebra that each process of a drive has a processor at most."""


class Child(Protocol):
    """A started process."""

    pid: int

    def poll(self) -> int | None:
        """Return the exit code, None while it runs."""

    def send_signal(self, sig: int) -> None:
        """Send a signal."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end."""


class Launcher(Protocol):
    """Starts one process; `module` is below the package `foretwin`."""

    def __call__(self, *, module: str, setup: ProcessSetup) -> Child:
        """Start a process running `module` with `setup`."""


class FreshInterpreter:
    """Starts each process as a new interpreter in a session of its own.

    A session of its own keeps a terminal's Ctrl-C from the children, which the orchestrator ends in
    order. The interpreter's standard error goes to the run's log, so that a crash leaves its
    traceback. What lies in the working directory is not imported (`-P`).
    """

    def __init__(self, folder: Path, *, package: str = "foretwin") -> None:
        self._folder, self._package = folder, package

    def __call__(self, *, module: str, setup: ProcessSetup) -> Child:
        """Start a fresh interpreter running `module` with `setup`."""
        setup_file = self._folder / f"{setup.process_id}.json"
        name = f"{self._package}.{module}"
        write_setup(setup, setup_file)
        own = ONE_THREAD | {STARTED_BY: f"{os.getpid()}"}
        with (self._folder / f"{setup.process_id}.stderr").open("ab") as stderr:
            return subprocess.Popen(
                [sys.executable, "-P", "-m", name, "--setup", str(setup_file)],
                stdin=subprocess.DEVNULL,
                stdout=stderr,
                stderr=stderr,
                start_new_session=True,
                env=os.environ | own,
            )
