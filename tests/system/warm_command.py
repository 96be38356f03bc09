"""Runs the command as a fork of an interpreter that has imported what it and its processes need.

Importing takes most of what a short drive costs. All else is as in a fresh interpreter, which
`entry=FRESH` of `started` asks for.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import itertools
import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from foretwin.orchestrator.drive.launching import IMPORTED_HERE
from foretwin.orchestrator.runner.fork_launch import forget_signals, keep_only, run_module
from foretwin.orchestrator.runner.warm_fork import ForkedProcess, forked

REPOSITORY = Path(__file__).parents[2]
NUMBER_BYTES = 16
_WHILE_IT_RUNS = ("scipy.stats.qmc", "pydantic.type_adapter")
"""What a drive imports only as it draws its first cases, and typer as it reads the first words."""


class WarmCommand:
    """A command in a fork; to be used as a subprocess.Popen whose stderr goes to its stdout.

    `changed_by` is a program that the fork runs before the command, to change what it does.
    """

    def __init__(
        self, words: list[str], *, cwd: Path, env: Mapping[str, str], changed_by: str = ""
    ) -> None:
        there, self._code = os.pipe()[::-1]
        out, stdout = os.pipe()[::-1]
        self.stdout = os.fdopen(stdout, encoding="utf-8")
        self.returncode: int | None = None
        asked = {"words": words, "cwd": str(cwd), "env": dict(env), "changed_by": changed_by}
        socket.send_fds(_interpreter(), [json.dumps(asked).encode()], [out, there])
        os.close(out)
        os.close(there)
        self.pid = int(os.read(self._code, NUMBER_BYTES))

    def poll(self) -> int | None:
        """Return the exit code, None while it runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end; raises subprocess.TimeoutExpired."""
        if self.returncode is None:
            if not select.select([self._code], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("foretwin", timeout or 0.0)
            self.returncode = int(os.read(self._code, NUMBER_BYTES))
            os.close(self._code)
        return self.returncode

    def communicate(self, *, timeout: float | None = None) -> tuple[str, None]:
        """Wait for the end, and return what it said; raises subprocess.TimeoutExpired."""
        said = b""
        while select.select([self.stdout], [], [], timeout)[0]:
            if not (part := os.read(self.stdout.fileno(), 65536)):
                self.wait(timeout)
                return said.decode(), None
            said += part
        raise subprocess.TimeoutExpired("foretwin", timeout or 0.0, said)

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, sig)

    def kill(self) -> None:
        """Kill it, unless it has ended."""
        self.send_signal(signal.SIGKILL)


@functools.cache
def _interpreter() -> socket.socket:
    """Start the interpreter that forks; it ends with the process that started it."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.system.warm_command", str(there.fileno())],
        cwd=REPOSITORY, pass_fds=[there.fileno()], stdin=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
                          "MUJOCO_GL": "disable"},
    )  # fmt: skip
    there.close()
    atexit.register(lambda: (here.close(), process.wait()))
    return here


def _be_command(asked: dict[str, Any], out: int) -> int:
    forget_signals()
    keep_only(out)
    os.chdir(asked["cwd"])
    os.environ.clear()
    os.environ.update(asked["env"])
    exec(asked["changed_by"], {})
    return run_module("foretwin", asked["words"])


def _serve(line: socket.socket) -> None:
    """Fork a command whenever one is asked for, and tell process and exit code of each."""
    for name in ("contracts.bus", "orchestrator.commands.cli", "orchestrator.drive.drive"):
        import_module(f"foretwin.{name}")
    for name in itertools.chain.from_iterable(IMPORTED_HERE.values()):
        import_module(f"foretwin.{name}")
    for name in _WHILE_IT_RUNS:
        import_module(name)
    running: dict[int, tuple[ForkedProcess, int]] = {}
    while True:
        ready = select.select([line, *running], [], [])[0]
        for ended in set(ready) & set(running):
            child, told = running.pop(ended)
            _tell(told, child.wait())
            os.close(told)
        if line not in ready:
            continue
        asked, files, _, _ = socket.recv_fds(line, 1 << 20, 2)
        if not asked:
            return
        out, told = files
        child = forked(functools.partial(_be_command, json.loads(asked), out))
        os.close(out)
        _tell(told, child.pid)
        running[child.ended] = child, told


def _tell(pipe: int, number: int) -> None:
    with contextlib.suppress(BrokenPipeError):
        os.write(pipe, f"{number:{NUMBER_BYTES}}".encode())


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _serve(socket.socket(fileno=int(sys.argv[1])))
