"""Planners that are not foretwin's own: each lives in a process of its own and answers in time.

One that blocks, exits or crashes fails its own futures of the present job; its
process is ended and a new one is ready for the next job. Only a live drive has rounds to keep:
elsewhere each answer is waited for, so that no result depends on how fast the machine is.
"""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import socket
import subprocess
import sys
from typing import NamedTuple

from foretwin.contracts.errors import UserError
from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView
from foretwin.sim_worker.planners.host_link import (
    ANSWER,
    FAILURE,
    QUESTION,
    SHARED,
    LinkLost,
    pack_question,
    read_answer,
    receive,
    send,
)

START_S = 60.0
"""To import its package and say so: many times what that takes, for a machine that is busy."""
FIRST_ANSWER_S, ANSWER_S = 1.0, 0.5
"""Of a planner in another process, or on another machine, in a live drive. Chosen."""
ALIVE_S = 30.0
"""Where no clock runs, who has not answered by then hangs or is not there. Chosen: a stack of 50 ms
does on a machine with six hundred times the work that it can do."""
MOST_HUNG_JOBS = 5
"""One that hung in so many jobs in a row is asked no more: each costs the whole limit."""
_BUFFER_BYTES = 1 << 20
_PROCESS = "foretwin.sim_worker.planners.host_process"

log = logging.getLogger("foretwin.sim_worker.planners")


class PlannerFailed(RuntimeError):  # noqa: N818
    """What a foreign planner did, in words for the engineer."""


class PlannerLost(PlannerFailed):
    """Its process hung or died: that says nothing of what it would have answered."""


class _Host(NamedTuple):
    process: subprocess.Popen[bytes]
    link: socket.socket


class HostedPlanner:
    """A planner of an installed package, named by its entry point's `value`."""

    def __init__(
        self,
        name: str,
        value: str,
        *,
        first_answer_s: float = ALIVE_S,
        answer_s: float = ALIVE_S,
    ) -> None:
        """Start its process; raises UserError where its package does not load."""
        self._name, self._value = name, value
        self.first_answer_s, self.answer_s = first_answer_s, answer_s
        self._live, self._hung_jobs = False, 0
        """Whether rounds are kept; in a row."""
        self._last: HostedDriver | None = None
        self._host: _Host | None = self._start()
        self._ready = False
        atexit.register(self.close)
        try:
            self._await_ready()
        except PlannerFailed as error:
            self.close()
            raise UserError(f"planner {name!r} ({value}) {error}") from error

    @property
    def pid(self) -> int | None:
        """The process it lives in now."""
        return None if self._host is None else self._host.process.pid

    def keep_pace(self) -> None:
        """Have it answer by the deadlines of a live drive."""
        self._live = True
        self.first_answer_s, self.answer_s = FIRST_ANSWER_S, ANSWER_S

    def begin(self, count: int) -> HostedDriver:
        """Return what drives one job's cars, in a new process if the last one was ended."""
        if self._last is not None and not self._last.lost:
            self._hung_jobs = 0
        self._last = HostedDriver(self, count)
        return self._last

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick as the first of a job."""
        return self.begin(len(view.arc_m)).plan(view)

    def close(self) -> None:
        """End its process."""
        self._end()
        atexit.unregister(self.close)

    def ask(self, body: bytes, *, begins: bool) -> tuple[PlannerOutput, dict[int, str]]:
        """Return the answer to a question; raises PlannerFailed, after which it starts anew."""
        if self._hung_jobs >= MOST_HUNG_JOBS and not self._live:
            raise PlannerLost(f"hung in {MOST_HUNG_JOBS} jobs in a row and is asked no more")
        if self._host is None:
            self._host = self._start()
        if not self._ready:
            self._await_ready()
        within_s = self.first_answer_s if begins else self.answer_s
        link = self._host.link
        try:
            send(link, QUESTION, body, within_s=within_s)
            frame = receive(link, within_s=within_s)
            if frame.kind == ANSWER:
                return read_answer(frame.body)
        except TimeoutError:
            self._hung_jobs += 1
            words = f"gave no answer within {within_s:g} s and was ended"
            raise PlannerLost(self._restarted(words)) from None
        except (LinkLost, ConnectionError):
            words = f"is gone: its process {self._ending()}"
            raise PlannerLost(self._restarted(words)) from None
        except ValueError as error:
            raise PlannerFailed(self._restarted(f"{error}; it was ended")) from None
        if frame.kind == FAILURE:
            raise PlannerFailed(frame.body.decode(errors="replace"))
        raise PlannerFailed(self._restarted("answered nonsense and was ended"))

    def _start(self) -> _Host:
        ours, theirs = socket.socketpair()
        for end in (ours, theirs):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        self._ready = False
        path = os.pathsep.join(entry or os.curdir for entry in sys.path)
        given: dict[str, object] = {"link": theirs.fileno(), "parent": os.getpid()}
        given |= {"name": self._name, "object": self._value}
        words = [str(word) for name, value in given.items() for word in (f"--{name}", value)]
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", _PROCESS, *words],
                pass_fds=(theirs.fileno(),),
                env=os.environ | {"PYTHONPATH": path},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )
        return _Host(process, ours)

    def _await_ready(self) -> None:
        assert self._host is not None
        try:
            frame = receive(self._host.link, within_s=START_S)
        except TimeoutError:
            self._end()
            raise PlannerFailed(f"did not load within {START_S:g} s") from None
        except (LinkLost, ConnectionError):
            ending = self._ending()
            self._end()
            raise PlannerFailed(f"fails to load: its process {ending}") from None
        if frame.kind == FAILURE:
            self._end()
            raise PlannerFailed(f"fails to load: {frame.body.decode(errors='replace')}")
        self._ready = True

    def _restarted(self, words: str) -> str:
        log.warning("planner %r %s", self._name, words)
        self._end()
        self._host = self._start()
        return words

    def _ending(self) -> str:
        assert self._host is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            return f"ended with code {self._host.process.wait(timeout=1.0)}"
        return "closed its link"

    def _end(self) -> None:
        if self._host is None:
            return
        host, self._host = self._host, None
        host.link.close()
        host.process.kill()
        host.process.wait()


class HostedDriver:
    """Drives one job's cars by asking the planner's process tick by tick; `lost` are those of
    which its failure says nothing."""

    def __init__(self, planner: HostedPlanner, count: int) -> None:
        self._planner, self._count, self._begins = planner, count, count
        self.lost: range = range(0)
        self._shared: list[object] = [self] * len(SHARED)
        self.remarks: dict[int, str] = {}

    def plan(self, view: PlannerView) -> PlannerOutput:
        """Answer one control tick; raises PlannerFailed."""
        shared = [getattr(view, name) for name in SHARED]
        fresh = any(new is not old for new, old in zip(shared, self._shared, strict=True))
        body = pack_question(view, begins=self._begins, with_shared=fresh)
        try:
            answer, remarks = self._planner.ask(body, begins=self._begins > 0)
        except PlannerLost:
            self.lost = range(self._count)
            raise
        self._begins, self._shared = 0, shared
        self.remarks.update(remarks)
        return answer
