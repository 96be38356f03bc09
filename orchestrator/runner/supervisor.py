"""Starts the processes of a drive, notices their deaths, restarts them, and ends them all.

The decisions (who is alive, who is restarted, when to give up) are in `Supervisor`; the
operating system's processes are behind `Launcher`, so that tests need none.
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import signal
import subprocess
import time
from collections import defaultdict, deque
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from foretwin.contracts.process_setup import ProcessSetup
from foretwin.orchestrator.runner.launch import Child, Launcher
from foretwin.orchestrator.runner.priorities import gives_way

log = logging.getLogger("orchestrator")

GIVES_WAY_AFTER_S = 1.0
"""So long after its death a process may still count as alive."""
RESTARTS_WITHIN_S = 60.0
TERM_S = 5.0
"""What a process that was told to leave has for its last words: on a busy machine one that writes a
file is slow, not stuck."""
_REAP_S = 30.0
MOST_STDERR_BYTES = 1_000_000  # of each process: what it said last
MAX_RESTARTS = 5
"""More deaths than this within RESTARTS_WITHIN_S and a process is given up."""
FIRST_PAUSE_S = 1.0
"""From the second death within RESTARTS_WITHIN_S to the start after it; then twice as long."""


WhenDead = Literal["restart", "report", "end_drive"]


class SupervisedRow(Protocol):
    """What a supervisor must know of a kind of process."""

    @property
    def module(self) -> str:
        """Its module below `foretwin`."""

    @property
    def when_dead(self) -> WhenDead:
        """What follows from its death."""

    @property
    def nice(self) -> int:
        """Added to its scheduling niceness once it can take work."""


@dataclass(frozen=True, slots=True)
class Death:
    """A process that ended although nobody asked it to."""

    process_id: str
    row: SupervisedRow
    exit_code: int
    restarted: bool
    """Whether it is started again, `pause_s` after its death."""
    pause_s: float
    seen_s: float
    """When that was seen, monotonic: what came of it later is its successor's."""


@dataclass(slots=True)
class _Managed:
    row: SupervisedRow
    setup: ProcessSetup
    child: Child
    gone: bool = False
    due_s: float | None = None
    """When one that died is started again."""


@dataclass(slots=True)
class Supervisor:
    """Owns the processes of one drive; call `poll` often (ten times a second or more)."""

    launch: Launcher
    started: int = 0
    restarted: int = 0
    _managed: dict[str, _Managed] = field(default_factory=dict)
    _deaths: dict[str, deque[float]] = field(default_factory=lambda: defaultdict(deque))
    _to_give_way: dict[str, float] = field(default_factory=dict)

    def start(self, row: SupervisedRow, setup: ProcessSetup) -> None:
        """Start one process."""
        child = self.launch(module=row.module, setup=setup)
        if row.nice:
            self._to_give_way[setup.process_id] = -math.inf
        log.info("started %s (%s) as process %d", setup.process_id, row.module, child.pid)
        self._managed[setup.process_id] = _Managed(row, setup, child)
        self.started += 1

    def poll(self, now_s: float) -> list[Death]:
        """Return the processes that died since the last call, restarted where the table says so.

        At once after the first death, then after pauses that grow.
        """
        deaths = []
        for process_id, managed in self._managed.items():
            exit_code = managed.child.poll()
            if not managed.gone and managed.due_s is None and exit_code is not None:
                pause_s = None
                if managed.row.when_dead == "restart":
                    pause_s = self.pause_s(process_id, now_s)
                managed.gone = pause_s is None
                managed.due_s = None if pause_s is None else now_s + pause_s
                again = not managed.gone
                died = Death(process_id, managed.row, exit_code, again, pause_s or 0.0, now_s)
                deaths.append(died)
            if managed.due_s is not None and now_s >= managed.due_s:
                self._start_again(managed, now_s)
        return deaths

    def anew(self) -> Supervisor:
        """Return a supervisor without processes, which goes on with the counts of this one."""
        return Supervisor(self.launch, self.started, self.restarted, _deaths=self._deaths)

    def _start_again(self, managed: _Managed, now_s: float) -> None:
        process_id = managed.setup.process_id
        try:
            managed.child = self.launch(module=managed.row.module, setup=managed.setup)
        except OSError as error:  # no memory, no room, no descriptor: that passes
            log.warning("%s cannot be started now: %s", process_id, error)
            managed.due_s = now_s + FIRST_PAUSE_S
            return
        managed.due_s = None
        if managed.row.nice:
            self._to_give_way[process_id] = now_s + GIVES_WAY_AFTER_S
        log.info("started %s again as process %d", process_id, managed.child.pid)
        self.restarted += 1

    def let_give_way(self, alive: Collection[str], now_s: float) -> None:
        """Let those of the processes `alive` give way that shall; call it as often as `poll`.

        Not before they can take work: at niceness, a start on a busy machine takes minutes.
        """
        for process_id, from_s in list(self._to_give_way.items()):
            managed = self._managed[process_id]
            if process_id not in alive or now_s < from_s:
                continue
            if gives_way(managed.child.pid, managed.row.nice):
                del self._to_give_way[process_id]

    def pause_s(self, process_id: str, now_s: float) -> float | None:
        """Count a death; return how long to wait before the next start, None where there is to be
        none: it died too often.
        """
        recent = self._deaths[process_id]
        recent.append(now_s)
        while recent and now_s - recent[0] > RESTARTS_WITHIN_S:
            recent.popleft()
        if len(recent) > MAX_RESTARTS:
            return None
        return 0.0 if len(recent) == 1 else FIRST_PAUSE_S * 2.0 ** (len(recent) - 2)

    def running(self) -> dict[str, int]:
        """Return the processes that have not ended, and the operating system's id of each."""
        return {
            name: one.child.pid
            for name, one in self._managed.items()
            if not one.gone and one.child.poll() is None
        }

    def kill(self, process_id: str) -> None:
        """End a process that hangs; `poll` then sees its death."""
        managed = self._managed.get(process_id)
        if managed is not None and not managed.gone:
            _signal(managed.child, signal.SIGKILL)

    def end(self, process_id: str, *, grace_s: float) -> None:
        """Wait for the end of a process that is no use any more, and kill it after `grace_s`."""
        child = self._managed[process_id].child
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(timeout=grace_s)
        self.kill(process_id)
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(timeout=_REAP_S)

    def row(self, process_id: str) -> SupervisedRow:
        """Return the table's row of a process."""
        return self._managed[process_id].row

    def stop(
        self, *, grace_s: float, term_s: float = TERM_S, but: Collection[str] = ()
    ) -> list[str]:
        """Wait `grace_s` for all `but` these to end by themselves, then terminate, then kill.

        Returns the ids that had to be killed. Those who gave way are waited for now.
        """
        ending = [managed for name, managed in self._managed.items() if name not in but]
        for managed in _alive(ending):
            if managed.row.nice:
                gives_way(managed.child.pid, 0)
        _wait(ending, grace_s)
        for managed in _alive(ending):
            _signal(managed.child, signal.SIGTERM)
            _signal(managed.child, signal.SIGCONT)
        _wait(ending, term_s)
        killed = _alive(ending)
        for managed in killed:
            _signal(managed.child, signal.SIGKILL)
        for managed in ending:
            with contextlib.suppress(subprocess.TimeoutExpired):
                managed.child.wait(timeout=_REAP_S)
            managed.gone = True
        return [managed.setup.process_id for managed in killed]


def _alive(ending: Collection[_Managed]) -> list[_Managed]:
    return [one for one in ending if not one.gone and one.child.poll() is None]


def _wait(ending: Collection[_Managed], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    for managed in _alive(ending):
        with contextlib.suppress(subprocess.TimeoutExpired):
            managed.child.wait(timeout=max(0.0, deadline - time.monotonic()))


def _signal(child: Child, sig: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        child.send_signal(sig)


def fold_stderr(folder: Path, log_file: Path) -> None:
    """Append what the processes wrote to standard error to the run's log, one JSON line each."""
    with log_file.open("a", encoding="utf-8") as log:
        for path in sorted(folder.glob("*.stderr")):
            with path.open("rb") as said:
                said.seek(max(0, path.stat().st_size - MOST_STDERR_BYTES))
                text = said.read().decode(errors="replace")
            for line in filter(str.strip, text.splitlines()):
                told = {"process": path.stem, "level": "stderr", "text": line}
                log.write(json.dumps(told) + "\n")
            path.unlink()
