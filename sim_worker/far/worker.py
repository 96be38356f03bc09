"""The process of a worker on another machine: joins a drive, and plays its jobs until told to go.

Told to end (SIGTERM) it answers what it has been asked and takes no more; lost it leaves nothing
behind that another worker could not do.
"""

from __future__ import annotations

import logging
import secrets
import time
from pathlib import Path

import msgspec

from foretwin.contracts.bus import Bus, Mailbox, Request
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.fleet import (
    Admittance,
    ClockAnswer,
    ClockQuestion,
    Enlisted,
    EnlistRequest,
)
from foretwin.contracts.guard import Refused
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.runner import JobAnswer
from foretwin.contracts.setup import FarWorkerSetup, WorkerSetup
from foretwin.contracts.terminal import say
from foretwin.contracts.tuning import UseVehicle
from foretwin.sim_worker.far.worlds import CachedWorlds
from foretwin.sim_worker.planners.registry import load_planner
from foretwin.sim_worker.worker import FuturesWorker, connect_planners

_IDLE_S = 0.2
_DEPTH = 64

log = logging.getLogger("sim_worker")


class Clock(Mailbox):
    """Answers at once whoever asks for the time, whatever the worker is at."""

    def __init__(self) -> None:
        super().__init__(1)

    def put(self, item: object) -> None:
        """Answer; what is no such question is refused."""
        if not isinstance(item, Request):
            return
        try:
            question = item.message()
        except Refused as refused:
            item.refuse(one_line(refused))
            return
        assert isinstance(question, ClockQuestion)
        item.reply(ClockAnswer(utc_ns=time.time_ns()))


class _Leaving(FuturesWorker):
    """A worker whose answers say once it takes no more."""

    def __init__(self, setup: WorkerSetup, life: ProcessLife, worlds: CachedWorlds) -> None:
        super().__init__(setup, worlds=worlds, refusals=life.refusals)
        self._life = life

    def answer(self, channel: str, question: msgspec.Struct) -> msgspec.Struct:
        """Answer as any worker does; see FuturesWorker."""
        answer = super().answer(channel, question)
        if isinstance(answer, JobAnswer) and self._life.terminated.is_set():
            return msgspec.structs.replace(answer, leaving=True)
        return answer


class FarWorker:
    """What a drive asks a worker on another machine; see FuturesWorker for the work itself."""

    def __init__(self, setup: FarWorkerSetup, bus: Bus, life: ProcessLife) -> None:
        self._setup, self._bus, self._life = setup, bus, life
        self._instance = secrets.token_hex(4)
        self._worker: FuturesWorker | None = None
        self.refused = ""
        """Why the drive does not want it."""

    def handle(self, request: Request) -> None:
        """Answer one question; never raises."""
        if request.channel not in ("enlist", "admit"):
            if self._worker is None:
                request.refuse("asked for work before it was told with what")
            else:
                self._worker.handle(request)
            return
        try:
            question = request.message()
            if isinstance(question, Admittance):
                self.refused = question.refused
                request.reply(question)
                return
            assert isinstance(question, EnlistRequest)
            request.reply(self._enlist(question))
        except Refused as refused:
            if text := self._life.refusals.take(refused):
                log.warning("%s", text)
            request.refuse(one_line(refused))
        except ValueError as error:
            request.refuse(one_line(error))

    def _enlist(self, question: EnlistRequest) -> Enlisted:
        """Be what the drive's own workers are; what is compiled already stays."""
        for name in question.planners:
            load_planner(name)  # raises ValueError for one that is not installed here
        if self._worker is None:
            self._worker = self._made(question)
        use = UseVehicle(stamp_ns=0, vehicle=question.vehicle, version=question.version)
        self._worker.answer("use_vehicle", use)
        return Enlisted(instance=self._instance, machine=self._setup.machine)

    def _made(self, question: EnlistRequest) -> FuturesWorker:
        given = self._setup
        setup = WorkerSetup(
            run_id=given.run_id,
            process_id=given.process_id,
            vehicle_id=given.vehicle_id,
            bus=given.bus,
            log_file=given.log_file,
            role="futures",
            worlds_dir="",
            vehicle=question.vehicle,
            simulations=question.simulations,
            kept_worlds=question.kept_worlds,
            control_hz=question.control_hz,
            planners=question.planners,
        )
        connect_planners(setup, self._bus)
        folder = Path(given.cache_dir)
        worlds = CachedWorlds(folder, self._bus, run=given.run_id, trouble=self._tell)
        return _Leaving(setup, self._life, worlds)

    def close(self) -> None:
        """End what it has started."""
        if self._worker is not None:
            self._worker.close()

    def _tell(self, text: str) -> None:
        log.warning("%s", text)
        say(f"{self._setup.process_id}: {text}", error=True)


def serve_far(setup: FarWorkerSetup, bus: Bus, life: ProcessLife) -> None:
    """Answer until the run is over, or what has been asked by when it is told to end.

    Raises UserError where the drive does not want this worker.
    """
    mailbox = Mailbox(_DEPTH)
    worker = FarWorker(setup, bus, life)
    ids = {"run": setup.run_id, "process": setup.process_id}
    for channel in ("enlist", "admit", "prepare", "job"):
        bus.serve(channel, mailbox, **ids)
    bus.serve("clock", Clock(), **ids)
    life.ready()
    while not life.over:
        request = mailbox.take(_IDLE_S)
        if isinstance(request, Request):
            worker.handle(request)
        if worker.refused:
            raise UserError(worker.refused)
    while not life.run_ended and isinstance(request := mailbox.take(), Request):
        worker.handle(request)
    worker.close()
