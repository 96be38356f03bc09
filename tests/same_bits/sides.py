"""The two sides: a tree each, whose commands run in processes that import that tree alone."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

HERE = Path(__file__).parent
REPOSITORY = HERE.parents[1]
INJECTED = HERE / "injected"
_ENTRIES = (
    ("foretwin/__main__.py", "foretwin"),
    ("foretwin", "foretwin.orchestrator"),
    ("orchestrator/__main__.py", "orchestrator"),
)
"""What a tree has, and what `python -m` then starts; the first that is there."""

_Answer = TypeVar("_Answer")


class SideError(RuntimeError):
    """A side did not do what it was asked; the message says which command, and where its log is."""


class Line(NamedTuple):
    """What one watched call left."""

    key: str
    parts: dict[str, str]


class Side:
    """One tree; `scratch` takes its caches, its runs and its logs."""

    def __init__(self, name: str, root: Path, scratch: Path) -> None:
        self.name, self.root, self.scratch = name, root, scratch
        self.entry = next(module for path, module in _ENTRIES if (root / path).exists())
        self._processes: list[subprocess.Popen[bytes]] = []
        (scratch / "empty").mkdir(parents=True)

    def run(self, name: str, *arguments: str, watched: str = "") -> list[Line]:
        """Run a command to its end; returns what calls of the `watched` functions left."""
        return self._start(name, [sys.executable, "-m", self.entry, *arguments], watched)

    def run_all(
        self, name: str, commands: Sequence[Sequence[str]], *, watched: str = ""
    ) -> tuple[list[Line], list[str]]:
        """Run commands in one process; returns also what each had on the screen.

        Raises SideError where one of them fails.
        """
        folder = self.scratch / name
        folder.mkdir()
        screens = [folder / f"screen-{number}" for number in range(len(commands))]
        listed = folder / "commands.json"
        listed.write_text(json.dumps([
            {"arguments": list(arguments), "screen": str(screen)}
            for arguments, screen in zip(commands, screens, strict=True)
        ]))  # fmt: skip
        loop = [sys.executable, "-P", str(HERE / "command_loop.py"), self.entry, str(listed)]
        lines = self._start(name, loop, watched)
        codes = json.loads(listed.with_name("commands.json.codes").read_text())
        for code, arguments in zip(codes, commands, strict=True):
            if code != 0:
                log = self.log(name)
                raise SideError(f"{self.name}: {' '.join(arguments)}: exit {code}; see {log}")
        return lines, [screen.read_text(encoding="utf-8") for screen in screens]

    def log(self, name: str) -> Path:
        """Return the file of what a command said."""
        return self.scratch / f"{name}.log"

    def interrupt(self) -> None:
        """Tell what runs to end."""
        for process in self._processes:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)

    def _start(self, name: str, command: Sequence[str], watched: str) -> list[Line]:
        told = self.scratch / f"{name}-calls"
        told.mkdir()
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join((str(INJECTED), str(self.root))),
            "XDG_CACHE_HOME": str(self.scratch / "cache"),
            "SAME_BITS_ROOT": str(self.root),
            "SAME_BITS_FOLDER": str(told),
            "SAME_BITS_WATCH": watched,
        }
        with self.log(name).open("wb") as log, subprocess.Popen(
            command, cwd=self.scratch / "empty", env=environment, stdin=subprocess.DEVNULL,
            stdout=log, stderr=log,
        ) as process:  # fmt: skip
            self._processes.append(process)
        if process.returncode != 0:
            raise SideError(
                f"{self.name}: {name}: exit {process.returncode}\n{_tail(self.log(name))}"
            )
        return list(_lines(told, f"{self.name}: {name}"))


@contextmanager
def two_sides(revision: str, scratch: Path) -> Iterator[tuple[Side, Side]]:
    """Check out a revision beside the working tree; it and all that still runs go at the end.

    Raises SideError where there is no such revision.
    """
    tree = scratch / "base-tree"
    added = _git("worktree", "add", "--detach", "--quiet", str(tree), revision)
    if added.returncode != 0:
        raise SideError(f"{revision}: {added.stderr.strip()}")
    sides = (Side("base", tree, scratch / "base"), Side("head", REPOSITORY, scratch / "head"))
    try:
        yield sides
    finally:
        for side in sides:
            side.interrupt()
        _git("worktree", "remove", "--force", str(tree))


def on_both(sides: Sequence[Side], do: Callable[[Side], _Answer]) -> tuple[_Answer, _Answer]:
    """Do the same on both sides at the same time."""
    with ThreadPoolExecutor(len(sides)) as pool:
        futures = [pool.submit(do, side) for side in sides]
        try:
            base, head = (future.result() for future in futures)
        except BaseException:
            for side in sides:
                side.interrupt()
            raise
    return base, head


def _git(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["git", "-C", str(REPOSITORY), *arguments], capture_output=True, text=True, check=False
    )


def _lines(folder: Path, where: str) -> Iterator[Line]:
    for path in sorted(folder.glob("*.jsonl")):
        for text in path.read_text(encoding="utf-8").splitlines():
            line: dict[str, Any] = json.loads(text)
            if "error" in line:
                raise SideError(f"{where}: a watched call could not be described: {line['error']}")
            yield Line(line["key"], line["parts"])


def _tail(path: Path) -> str:
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    return "\n".join(f"    {line}" for line in lines[-15:])
