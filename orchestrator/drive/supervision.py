"""What the orchestrator and its supervisor say to each other, and what it sees of the processes."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection, Iterator
from typing import NamedTuple, Protocol

import msgspec

from foretwin.orchestrator.drive.process_watch import WatchedProcesses
from foretwin.orchestrator.drive.processes import ProcessRow, rows_by_id
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.runner.supervisor import Death, Supervisor

MOST_BYTES = 64 * 1024
"""Of one message. A buffer of this size is made for each that is waited for, ten times a second and
more: one of megabytes comes from the heap in the end, and lets it grow."""


CRASH, CRASHED = "an error of its own", 70
"""How an orchestrator ended that may be started again, in words, and its exit code."""


class DriveError(RuntimeError):
    """A drive that could not go on; the message says why."""


class Life(NamedTuple):
    """What an orchestrator begins with."""

    began_s: float
    """When the drive began, by the monotonic clock."""
    standing: bytes = b""
    """What the one before it left; empty where there is nothing to go on from."""
    ended_by: tuple[str, ...] = ()
    """How each one before it ended, in words."""
    last: bool = False
    """They died too often: this one brings the drive to its end."""


class ToldDeath(msgspec.Struct, frozen=True, array_like=True):
    """A death that the supervisor saw; see Death."""

    process_id: str
    exit_code: int
    restarted: bool
    pause_s: float
    seen_s: float


class Running(msgspec.Struct, frozen=True, tag=True):
    """How the processes of a drive are: sent whenever it changes.

    `deaths` are those that no orchestrator is known to have told of, the run's `first`th and on.
    """

    pids: dict[str, int]
    restarted: int
    first: int
    deaths: list[ToldDeath]


class Interrupt(msgspec.Struct, frozen=True, tag=True):
    """The drive shall end: Ctrl-C, SIGTERM, or a closed terminal."""


class Stopped(msgspec.Struct, frozen=True, tag=True):
    """All processes have ended, these of them since they were killed."""

    killed: list[str]


class Kill(msgspec.Struct, frozen=True, tag=True):
    """A process hangs: it shall be killed."""

    process_id: str


class TakeWork(msgspec.Struct, frozen=True, tag=True):
    """These processes can take work: those that shall give way may do so now."""

    process_ids: list[str]


class HandOver(msgspec.Struct, frozen=True, tag=True):
    """With it comes, as a file in memory, what the next orchestrator is to go on from."""

    deaths: int
    """So many deaths of the run are told, and need not be told again."""


class Stop(msgspec.Struct, frozen=True, tag=True):
    """The drive is over: wait so long for the processes, then end them."""

    grace_s: float
    but: list[str]
    """These go on until they are told too."""


class Refusal(msgspec.Struct, frozen=True, tag=True):
    """The drive has ended by an error, and which, in one line; of the user's, or of ours."""

    text: str
    by_user: bool


ToOrchestrator = Running | Interrupt | Stopped
ToSupervisor = Kill | TakeWork | HandOver | Stop | Refusal

ENCODER = msgspec.msgpack.Encoder()


@contextlib.contextmanager
def in_memory(data: bytes) -> Iterator[int]:
    """Give the descriptor of a file in memory alone that holds these bytes."""
    descriptor = os.memfd_create("standing", os.MFD_CLOEXEC)
    try:
        written = 0
        while written < len(data):
            written += os.write(descriptor, memoryview(data)[written:])
        yield descriptor
    finally:
        os.close(descriptor)


def taken_over(descriptor: int) -> bytes:
    """Return what a file in memory holds, and let go of it."""
    try:
        return os.pread(descriptor, os.fstat(descriptor).st_size, 0)
    finally:
        os.close(descriptor)


class DriveProcesses(WatchedProcesses, Protocol):
    """The processes of a drive as the orchestrator sees them."""

    @property
    def restarted(self) -> int:
        """How many processes were started again."""

    @property
    def over(self) -> bool:
        """Whether the drive is to end: it was told so, or its supervisor is gone."""

    @property
    def start_again(self) -> bool:
        """Whether an orchestrator that dies is started again."""

    def let_give_way(self, alive: Collection[str], now_s: float) -> None:
        """Let those of the processes `alive` give way that shall."""

    def keep(self, standing: bytes) -> None:
        """Hand over what the next orchestrator is to go on from."""

    def stop(self, *, grace_s: float, but: Collection[str] = ()) -> list[str]:
        """Wait for all `but` these to end, then end them; returns the ids that were killed."""


class OwnProcesses:
    """The processes of a drive whose orchestrator is their supervisor: nobody starts it again."""

    over = start_again = False

    def __init__(self, plan: DrivePlan, supervisor: Supervisor) -> None:
        self._supervisor, self._rows = supervisor, rows_by_id(plan)

    @property
    def restarted(self) -> int:
        """How many processes were started again."""
        return self._supervisor.restarted

    def poll(self, now_s: float) -> list[Death]:
        """Return deaths since the last call; see DriveProcesses."""
        return self._supervisor.poll(now_s)

    def running(self) -> dict[str, int]:
        """Return who has not ended, and the operating system's id of each."""
        return self._supervisor.running()

    def row(self, process_id: str) -> ProcessRow:
        """Return the table's row of a process."""
        return self._rows[process_id]

    def kill(self, process_id: str) -> None:
        """End a process that hangs."""
        self._supervisor.kill(process_id)

    def let_give_way(self, alive: Collection[str], now_s: float) -> None:
        """Let those of the processes `alive` give way that shall."""
        self._supervisor.let_give_way(alive, now_s)

    def keep(self, standing: bytes) -> None:
        """Nobody goes on from it."""

    def stop(self, *, grace_s: float, but: Collection[str] = ()) -> list[str]:
        """Wait for all to end; see DriveProcesses."""
        return self._supervisor.stop(grace_s=grace_s, but=but)
