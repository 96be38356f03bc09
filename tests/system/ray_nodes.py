"""Nodes of Ray, each a machine of its own as far as it can tell: a network and processes.

Ray listens on whatever interface there is, whatever it is told: here that is a wire that leads
nowhere else. A node that is killed takes all its processes with it, as a power cut does.
"""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Self

import pytest

from tests.contracts.bus_sides import DEADLINE_S
from tests.system.foretwin_command import REPOSITORY

PORT = 6379
RAY_DEADLINE_S = 3.0 * DEADLINE_S
"""Each node is a dozen processes, and each seat one that imports all: on a busy machine minutes."""
_NUMBERS = itertools.count()
_UNSHARE = ("unshare", "--pid", "--fork", "--mount-proc", "--kill-child")
_STORE_BYTES = 80_000_000


def ray_python() -> Path:
    """Return the Python of an environment with foretwin[ray]; skips the test without one."""
    if "RAY_VENV" not in os.environ:
        pytest.skip("RAY_VENV names no environment with foretwin[ray]")
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("networks of their own need root and iproute2")
    return Path(os.environ["RAY_VENV"]) / "bin" / "python"


class RayNodes:
    """Up to so many nodes on one wire, each with a processor; the first one is the head.

    Commands run as if typed on the first one. Use it as a context.
    """

    def __init__(self, count: int, *, processors: int = 1) -> None:
        self.python, self._processors = ray_python(), processors
        wire = f"ray-{os.getpid()}-{next(_NUMBERS)}"
        self._names, self._wire = [f"{wire}-{number}" for number in range(count)], wire
        self._running: dict[int, subprocess.Popen[bytes]] = {}
        self.folder = Path(tempfile.mkdtemp(prefix="fr-"))  # Sockets have short paths.
        self.address = f"{self.ip(0)}:{PORT}"

    @staticmethod
    def ip(number: int) -> str:
        return f"10.77.0.{number + 1}"

    def __enter__(self) -> Self:
        _ip("netns", "add", self._wire)
        _ip("-n", self._wire, "link", "add", "wire", "type", "bridge")
        _ip("-n", self._wire, "link", "set", "wire", "up")
        for number, name in enumerate(self._names):
            end = f"end{number}"
            _ip("netns", "add", name)
            _ip("-n", name, "link", "set", "lo", "up")
            peer = ("type", "veth", "peer", "name", end, "netns", self._wire)
            _ip("link", "add", "eth0", "netns", name, *peer)
            _ip("-n", self._wire, "link", "set", end, "master", "wire", "up")
            _ip("-n", name, "addr", "add", f"{self.ip(number)}/24", "dev", "eth0")
            _ip("-n", name, "link", "set", "eth0", "up")
        return self

    def __exit__(self, *what: object) -> None:
        for number in list(self._running):
            self.kill(number)
        for name in [*self._names, self._wire]:
            subprocess.run(["ip", "netns", "del", name], check=False, stderr=subprocess.DEVNULL)
        shutil.rmtree(self.folder, ignore_errors=True)

    def start(
        self, number: int, *, processors: int | None = None, before_path: Path | None = None
    ) -> None:
        """Start a node and wait until it is one; `before_path` goes before what it imports."""
        first = ("--head", f"--port={PORT}", "--include-dashboard=false")
        role = first if number == 0 else (f"--address={self.address}",)
        screen = self.folder / f"node{number}.txt"
        command = (
            *self._within(number, apart=True),
            *(str(self.python.with_name("ray")), "start", *role, "--block"),
            f"--node-ip-address={self.ip(number)}",
            f"--num-cpus={self._processors if processors is None else processors}",
            f"--object-store-memory={_STORE_BYTES}",
            *((f"--temp-dir={self.folder / 'ray'}",) if number == 0 else ()),
        )
        with screen.open("wb") as file:
            self._running[number] = subprocess.Popen(
                command,
                env=self.environment(before_path),
                stdout=file,
                stderr=subprocess.STDOUT,
            )
        waited = self.run("-c", _WAIT, self.address, self.ip(number), str(RAY_DEADLINE_S))
        assert waited.returncode == 0, (waited.stderr, screen.read_text(errors="replace"))

    def kill(self, number: int) -> None:
        """Take a node away, with all its processes, as a power cut does."""
        process = self._running.pop(number)
        process.kill()
        process.wait(DEADLINE_S)

    def cut(self, number: int, *, mended: bool = False) -> None:
        """Cut a node off the wire, or connect it again; its processes know nothing of it."""
        state = "up" if mended else "down"
        _ip("-n", self._wire, "link", "set", f"end{number}", state)

    def environment(self, before_path: Path | None = None) -> dict[str, str]:
        paths = [str(path) for path in (before_path, REPOSITORY) if path is not None]
        return os.environ | {
            "PYTHONPATH": os.pathsep.join(paths),
            "RAY_USAGE_STATS_ENABLED": "0",
            "RAY_AUTH_MODE": "disabled",
            "RAY_raylet_start_wait_time_s": f"{RAY_DEADLINE_S:.0f}",
            "XDG_CACHE_HOME": str(self.folder / "cache"),
        }

    def _within(self, number: int, *, apart: bool) -> tuple[str, ...]:
        return ("ip", "netns", "exec", self._names[number], *(_UNSHARE if apart else ()))

    def started(self, *arguments: str, on: int = 0, **options: object) -> subprocess.Popen[str]:
        """Start Python on a node."""
        command = (*self._within(on, apart=False), str(self.python), *arguments)
        return subprocess.Popen(
            command,
            env=self.environment(),
            cwd=REPOSITORY,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(
        self,
        *arguments: str,
        on: int = 0,
        check: bool = False,
        within_s: float = RAY_DEADLINE_S,
        before_path: Path | None = None,
    ) -> subprocess.CompletedProcess[str]:
        """Run Python on a node to its end."""
        command = (*self._within(on, apart=False), str(self.python), *arguments)
        return subprocess.run(
            command,
            env=self.environment(before_path),
            cwd=REPOSITORY,
            capture_output=True,
            text=True,
            check=check,
            timeout=within_s,
        )

    def alone(
        self, *command: str, on: int = 0, within_s: float = RAY_DEADLINE_S
    ) -> subprocess.CompletedProcess[str]:
        """Run any command to its end on a node that sees no processes but its own."""
        return subprocess.run(
            (*self._within(on, apart=True), *command),
            env=self.environment(),
            cwd=REPOSITORY,
            capture_output=True,
            text=True,
            check=False,
            timeout=within_s,
        )


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


_WAIT = """
import socket, sys, time
from foretwin.orchestrator.runner import ray_cluster
address, node, within_s = sys.argv[1:]
until_s = time.monotonic() + float(within_s)
while time.monotonic() < until_s:
    try:
        socket.create_connection(tuple(address.split(":")), timeout=1.0).close()
        break
    except OSError:
        time.sleep(0.1)
import ray
while not ray.is_initialized():
    try:
        ray.init(address=address, log_to_driver=False, logging_level="error")
    except ConnectionError:  # the head listens before it is a node
        assert time.monotonic() < until_s
while not any(one["Alive"] and one["NodeManagerAddress"] == node for one in ray.nodes()):
    assert time.monotonic() < until_s, ray.nodes()
    time.sleep(0.1)
"""
