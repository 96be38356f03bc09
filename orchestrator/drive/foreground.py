"""The supervisor of a drive: the process that `foretwin drive` stays once everything is read.

It starts, watches and ends all others, most as forks (`launching.py`), and forks the orchestrator
from what lies in its memory. An orchestrator that dies is forked again at once, and goes on with
what it left, beside processes that know nothing of it. The supervisor has no thread, no bus and no
table: nothing that others send or a disk does can end it.
"""

from __future__ import annotations

import contextlib
import logging
import select
import shutil
import signal
import time
from collections.abc import Callable

from foretwin.contracts.cpu_use import CpuMeter
from foretwin.contracts.errors import UserError
from foretwin.contracts.one_heap import share_one_heap
from foretwin.contracts.process_name import name_process
from foretwin.contracts.terminal import command_line, say
from foretwin.orchestrator.drive.exit_words import EXIT_FAILED
from foretwin.orchestrator.drive.interrupt import Interruption
from foretwin.orchestrator.drive.orchestrator_link import OrchestratorLink, linked
from foretwin.orchestrator.drive.processes import ORCHESTRATOR, ROUTER, SUPERVISOR, rows_by_id
from foretwin.orchestrator.drive.router_start import start_router
from foretwin.orchestrator.drive.start_anew import forget_results
from foretwin.orchestrator.drive.supervision import (
    CRASH,
    CRASHED,
    DriveError,
    HandOver,
    Kill,
    Life,
    Refusal,
    Running,
    Stop,
    TakeWork,
    ToldDeath,
)
from foretwin.orchestrator.drive.supervisor_link import SupervisorLink
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.runner.launch import Launcher
from foretwin.orchestrator.runner.supervisor import Supervisor
from foretwin.orchestrator.runner.warm_fork import ForkedProcess, forked

log = logging.getLogger(ORCHESTRATOR)

LOOK_S = 0.05
FORK_AGAIN_S, WITHOUT_MEMORY_S = 0.5, 30.0


Orchestrate = Callable[[DrivePlan, SupervisorLink, Life], int]


class Foreground:
    """Carries out one drive; `orchestrate` is the work of the forks.

    Use `run` once. Raises UserError for what the orchestrator finds wrong with what was asked for.
    """

    def __init__(self, plan: DrivePlan, orchestrate: Orchestrate, *, launch: Launcher) -> None:
        self._plan, self._orchestrate = plan, orchestrate
        self._supervisor = Supervisor(launch)
        self._interruption = Interruption()
        self._began_s = time.monotonic()
        self._meter = CpuMeter(plan.processes_dir, SUPERVISOR, alone=True)
        self._standing = b""
        self._refusal: Refusal | None = None
        self._ended_by: list[str] = []
        self._deaths: list[ToldDeath] = []
        self._first_death = 0

    def run(self, *, meanwhile: Callable[[], object] = lambda: None) -> int:
        """Run the drive to its end, `meanwhile` while processes start; returns its exit code."""
        start_all(self._supervisor, self._plan)
        meanwhile()
        self._meter.ready()
        life: Life | None = Life(self._began_s)
        try:
            while life is not None:
                how = _died_of(code := self._live(life))
                life = None if how is None else self._next_life(how, life)
        finally:
            self._supervisor.stop(grace_s=0.0)
        if self._refusal is not None:
            if self._refusal.by_user:
                shutil.rmtree(self._plan.folder, ignore_errors=True)
                raise UserError(self._refusal.text)
            raise DriveError(self._refusal.text)
        if how is None:
            return code
        say(
            f"error: the orchestrator ended by {how}, the last of {len(self._ended_by)} times; "
            f"`{command_line('recover', self._plan.folder)}` makes readable what there is",
            error=True,
        )
        return EXIT_FAILED

    def _live(self, life: Life) -> int:
        """Let an orchestrator live, serve it, and return its exit code."""
        here, there = linked()

        def work() -> int:
            here.close()
            name_process(ORCHESTRATOR)
            share_one_heap()
            # What comes before the orchestrator takes signals itself is for it as well.
            link = SupervisorLink(
                there,
                self._plan,
                deaths_known=self._first_death,
                inherited=self._interruption,
            )
            return self._orchestrate(self._plan, link, life)

        child = self._forked(work)
        log.info("forked the orchestrator as process %d", child.pid)
        there.close()
        line = OrchestratorLink(here)
        while (code := child.poll()) is None:
            select.select([line.fileno(), child.ended], [], [], LOOK_S)
            with contextlib.suppress(MemoryError):  # it passes, and what was not heard waits
                self._serve(line)
        self._serve(line)  # what it said last
        line.close()
        return code

    def _forked(self, work: Callable[[], int]) -> ForkedProcess:
        """Fork, where there is no memory for it now as soon as there is some.

        Raises what forking does after a while, and where the drive shall end.
        """
        until_s = time.monotonic() + WITHOUT_MEMORY_S
        while True:
            try:
                return forked(work)
            except (OSError, MemoryError) as error:
                log.warning("the orchestrator cannot be forked now: %s", error)
                if self._interruption.asked or time.monotonic() > until_s:
                    raise
            select.select([], [], [], FORK_AGAIN_S)

    def _serve(self, line: OrchestratorLink) -> None:
        if self._interruption.asked:
            line.interrupt()
        for said in line.hear():
            match said:
                case Kill(process_id):
                    self._supervisor.kill(process_id)
                case TakeWork(process_ids):
                    self._supervisor.let_give_way(process_ids, time.monotonic())
                case HandOver(deaths):
                    self._standing = line.standing
                    del self._deaths[: max(0, deaths - self._first_death)]
                    self._first_death = max(self._first_death, deaths)
                case Stop(grace_s, but):
                    line.stopped(self._supervisor.stop(grace_s=grace_s, but=but))
                case Refusal():
                    self._refusal = said
        self._look_after_processes()
        self._meter.look()
        supervisor = self._supervisor
        line.tell(
            Running(
                supervisor.running(), supervisor.restarted, self._first_death, list(self._deaths)
            )
        )

    def _look_after_processes(self) -> None:
        for one in self._supervisor.poll(time.monotonic()):
            told = ToldDeath(one.process_id, one.exit_code, one.restarted, one.pause_s, one.seen_s)
            self._deaths.append(told)

    def _next_life(self, how: str, before: Life) -> Life | None:
        """Return what the next orchestrator begins with, after a pause where they die often.

        None where there shall be none, or nothing that it could bring to an end.
        """
        now_s = time.monotonic()
        log.error("the orchestrator ended by %s", how)
        self._ended_by.append(how)
        pause_s = self._supervisor.pause_s(ORCHESTRATOR, now_s)
        if before.last or (pause_s is None and not self._standing):
            return None
        if self._plan.config.lock_step:
            # The same input gives the same bits: nothing is lost where all is played again.
            self._supervisor.stop(grace_s=0.0, term_s=0.0)
            forget_results(self._plan)
            self._supervisor = self._supervisor.anew()
            self._deaths, self._first_death = [], 0
            start_all(self._supervisor, self._plan)
        while pause_s and time.monotonic() < now_s + pause_s and not self._interruption.asked:
            select.select([], [], [], LOOK_S)
            self._look_after_processes()
        return Life(self._began_s, self._standing, tuple(self._ended_by), last=pause_s is None)


def start_all(supervisor: Supervisor, plan: DrivePlan) -> None:
    """Start all processes of a drive but the orchestrator, the router first.

    Raises UserError, with no folder left, where the router cannot listen.
    """
    start_router(plan, supervisor)
    for process_id, row in rows_by_id(plan).items():
        if process_id != ROUTER:
            supervisor.start(row, row.setup(plan, process_id))


def _died_of(code: int) -> str | None:
    """Return of what an orchestrator died, in words; None where it came to an end of its own."""
    if code == CRASHED:
        return CRASH
    if code >= 0:
        return None
    return f"signal {-code} ({signal.Signals(-code).name})"
