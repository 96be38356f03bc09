"""A worker in a process that somebody else starts and ends, such as one of Ray's.

It is told all it needs with each question: the setup, and the bytes of the World.
"""

from __future__ import annotations

import contextlib
import faulthandler
import hashlib
import logging
import os
import signal
import socket
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec

from foretwin.contracts.arithmetic import arithmetic_sha256
from foretwin.contracts.codec import decode_content, encode
from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.guard import opened
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.log_file import JsonLines
from foretwin.contracts.setup import WorkerSetup
from foretwin.contracts.versions import versions
from foretwin.contracts.world import World
from foretwin.contracts.world_identity import checked_world
from foretwin.sim_worker.planners.origin import files_digest
from foretwin.sim_worker.planners.registry import planner_origin
from foretwin.sim_worker.worker import FuturesWorker

_DECIDING = "contracts", "geometry", "sim_worker", "world_gen"
"""The rooms whose files decide what comes of a job."""
_DIGITS = 8
HANGS_S = 30.0
"""Who has not noticed for so long that its time is over does not come back from a library."""
MOST_LOG_LINES = 100
"""Of one answer."""


class SeatSetup(msgspec.Struct, frozen=True, kw_only=True):
    """What a seat is: a worker, made of what decides results, and its time."""

    worker: WorkerSetup
    made_of: dict[str, str]
    """See `made_of`."""
    limit_s: float
    """An answer that takes longer is given up."""


def made_of(planners: Iterable[str]) -> dict[str, str]:
    """Return what decides results here: versions, and hashes of our files and of planners."""
    found = versions()
    rooms = [Path(__file__).parents[1] / room for room in _DECIDING]
    found["arithmetic"] = arithmetic_sha256()
    found["foretwin"] += f" ({files_digest(rooms)[:_DIGITS]})"
    for name in planners:
        try:
            origin = planner_origin(name)
        except UserError:
            continue  # What is not here differs from whatever is elsewhere.
        found[f"planner {name}"] = f"{origin.version} ({origin.files_sha256[:_DIGITS]})"
    return found


class SeatQuestion(NamedTuple):
    """A question as it is sent: the message of a channel as bytes."""

    channel: str
    world_id: str
    data: bytes


class SeatAnswer(NamedTuple):
    """What came of a question: the bytes of the channel's reply, or why there is none."""

    seat: str
    data: bytes = b""
    refusal: str = ""
    late: bool = False
    strange: str = ""
    """How this seat differs from what it is to be: it answers nothing."""
    log: tuple[bytes, ...] = ()
    """Lines for the log of the run."""


class _TooLateError(BaseException):
    """The time for an answer is over; no code on the way may take it for an error of its own."""


class _WorldAtHand:
    """The World that came with the question."""

    def __init__(self) -> None:
        self.data: bytes | None = None

    def world(self, world_id: str) -> World:
        """Return it; see WorldSource."""
        if self.data is None:
            raise FileNotFoundError(f"World {world_id} did not come with the question")
        return checked_world(self.data, world_id, where="the World that came with the question")


class _SeatLog(logging.Handler):
    def __init__(self, seat: str) -> None:
        super().__init__(logging.WARNING)
        self.setFormatter(JsonLines(seat))
        self.lines: list[bytes] = []

    def emit(self, record: logging.LogRecord) -> None:
        if len(self.lines) < MOST_LOG_LINES:
            self.lines.append(self.format(record).encode(errors="backslashreplace"))


class Seat:
    """One worker of a run, which keeps its compiled Worlds from question to question."""

    def __init__(self, setup: SeatSetup) -> None:
        self.name = f"{socket.gethostname()}-{os.getpid()}"
        self._setup, self._at_hand = setup, _WorldAtHand()
        self._strange = _difference(setup.made_of)
        self._worker: FuturesWorker | None = None

    def answer(self, question: SeatQuestion, world: bytes | None) -> SeatAnswer:
        """Answer one question; never raises."""
        if self._strange:
            return SeatAnswer(self.name, strange=self._strange)
        log, lines = logging.getLogger(), _SeatLog(self.name)
        log.addHandler(lines)
        try:
            return self._answer(question, world)._replace(log=tuple(lines.lines))
        finally:
            log.removeHandler(lines)

    def _answer(self, question: SeatQuestion, world: bytes | None) -> SeatAnswer:
        limit_s = self._setup.limit_s
        self._at_hand.data = world
        try:
            with _within(limit_s):
                return SeatAnswer(self.name, encode(self._reply(question)))
        except _TooLateError:
            self.close()  # What it was in the middle of nobody knows.
            return SeatAnswer(self.name, refusal=f"no answer in {limit_s:g} s", late=True)
        except Exception as error:
            logging.getLogger("sim_worker").exception("%s refused", question.channel)
            return SeatAnswer(self.name, refusal=one_line(error))
        finally:
            self._at_hand.data = None

    def close(self) -> None:
        """End what its worker has started; the next question finds another one."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None

    def _reply(self, question: SeatQuestion) -> msgspec.Struct:
        if self._worker is None:
            setup = msgspec.structs.replace(self._setup.worker, process_id=self.name)
            self._worker = FuturesWorker(setup, worlds=self._at_hand)
        kind = CHANNELS[question.channel].kind
        message = opened(question.data, kind, where=question.channel).message
        return self._worker.answer(question.channel, message)


_HERE: dict[str, Seat] = {}
"""The seat of this process by what it was set up with; one run after another may use it."""


def answer_here(setup: bytes, question: SeatQuestion, world: bytes | None) -> SeatAnswer:
    """Answer one question in this process, whose seat stays as long as the setup is the same."""
    name = hashlib.sha256(setup).hexdigest()
    if name not in _HERE:
        for earlier in _HERE.values():
            earlier.close()
        _HERE.clear()
        _HERE[name] = Seat(decode_content(setup, SeatSetup, where="the setup of a seat"))
    return _HERE[name].answer(question, world)


def _difference(wanted: dict[str, str]) -> str:
    """Return in words how what decides results here differs from what the run wants."""
    planners = [name.removeprefix("planner ") for name in wanted if name.startswith("planner ")]
    here = made_of(planners)
    differing = [
        f"{name} {here.get(name, 'missing')} instead of {wanted.get(name, 'none')}"
        for name in sorted({*here, *wanted})
        if here.get(name) != wanted.get(name)
    ]
    return f"{socket.gethostname()} has {', '.join(differing)}" if differing else ""


@contextlib.contextmanager
def _within(limit_s: float) -> Iterator[None]:
    """Raise in it after so long; a process that then does not come back either is ended."""

    def late(*_: object) -> None:
        raise _TooLateError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, limit_s)
    faulthandler.dump_traceback_later(limit_s + HANGS_S, exit=True, file=2)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
