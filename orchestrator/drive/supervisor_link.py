"""The orchestrator's end of the line to its supervisor.

Nothing here holds up a drive: what the orchestrator says goes out at once or is said again, and
what the supervisor does is told by it whenever it changes. Either knows at once when one is gone.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import signal
import socket
import time
from collections.abc import Collection

import msgspec

from foretwin.contracts.end_signals import leave_closed_terminal
from foretwin.contracts.process import is_held
from foretwin.orchestrator.drive.interrupt import Interruption
from foretwin.orchestrator.drive.processes import ProcessRow, rows_by_id
from foretwin.orchestrator.drive.supervision import (
    ENCODER,
    MOST_BYTES,
    HandOver,
    Interrupt,
    Kill,
    Refusal,
    Running,
    Stop,
    Stopped,
    TakeWork,
    ToldDeath,
    ToOrchestrator,
    ToSupervisor,
    in_memory,
)
from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.runner.supervisor import TERM_S, Death

_SLACK_S = 10.0
"""How much longer than it was given the supervisor may take to end all processes."""
_LOOK_S = 0.05

_GONE = frozenset({errno.EPIPE, errno.ECONNRESET, errno.ENOTCONN, errno.EBADF})

_decoder = msgspec.msgpack.Decoder(ToOrchestrator)


class SupervisorLink:
    """The orchestrator's side; see DriveProcesses."""

    def __init__(
        self,
        end: socket.socket,
        plan: DrivePlan,
        *,
        deaths_known: int = 0,
        inherited: Interruption | None = None,
    ) -> None:
        """`inherited` takes the signals of a fork that takes none itself yet."""
        end.setblocking(False)
        self._inherited = inherited
        self._end, self._rows = end, rows_by_id(plan)
        self._setups = plan.processes_dir
        self._running = Running({}, 0, 0, [])
        self._told = deaths_known
        self._alive: list[str] = []
        self._stopped: list[Stopped] = []
        self._told_to_end = False
        self.alone = False
        """Whether the supervisor is gone: nobody starts anything again."""

    @property
    def over(self) -> bool:
        """Whether the drive is to end."""
        asked = self._inherited is not None and self._inherited.asked
        return asked or self.alone or self._told_to_end

    @property
    def start_again(self) -> bool:
        """Whether an orchestrator that dies is started again."""
        return not self.alone

    @property
    def restarted(self) -> int:
        """How many processes were started again."""
        return self._running.restarted

    def poll(self, now_s: float) -> list[Death]:
        """Return deaths that the supervisor newly told of."""
        self._hear()
        new = self._running.deaths[max(0, self._told - self._running.first) :]
        self._told += len(new)
        return [self._death(one) for one in new]

    def _death(self, one: ToldDeath) -> Death:
        row = self._rows[one.process_id]
        return Death(one.process_id, row, one.exit_code, one.restarted, one.pause_s, one.seen_s)

    def running(self) -> dict[str, int]:
        """Return who ran when the supervisor last told, and the operating system's id of each."""
        return self._running.pids

    def row(self, process_id: str) -> ProcessRow:
        """Return the table's row of a process."""
        return self._rows[process_id]

    def kill(self, process_id: str) -> None:
        """Have a process killed that hangs."""
        self._say(Kill(process_id))

    def let_give_way(self, alive: Collection[str], now_s: float) -> None:
        """Tell who can take work, where that is news."""
        now = sorted(set(alive) & self._rows.keys())
        if now != self._alive and self._say(TakeWork(now)):
            self._alive = now

    def keep(self, standing: bytes) -> None:
        """Hand over what the next orchestrator is to go on from, however long it is."""
        with in_memory(standing) as descriptor:
            self._say(HandOver(self._told), descriptor)

    def refuse(self, text: str, *, by_user: bool) -> None:
        """Say by which error the drive has ended."""
        self._say(Refusal(text, by_user))

    def stop(self, *, grace_s: float, but: Collection[str] = ()) -> list[str]:
        """Have all processes ended, and wait for that; returns the ids that had to be killed."""
        deadline_s = time.monotonic() + grace_s + TERM_S + _SLACK_S
        self._stopped.clear()
        self._say(Stop(grace_s, list(but)))
        while not (self._stopped or self.alone) and time.monotonic() < deadline_s:
            self._hear(wait_s=_LOOK_S)
        if self._stopped:
            return self._stopped[-1].killed
        return self._wait_alone(grace_s + TERM_S, but)

    def _wait_alone(self, grace_s: float, but: Collection[str]) -> list[str]:
        """Wait for processes whose supervisor is gone: they leave of themselves."""
        deadline_s = time.monotonic() + grace_s
        while (left := self._left(but)) and time.monotonic() < deadline_s:
            time.sleep(_LOOK_S)
        for pid in left.values():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        return list(left)

    def _left(self, but: Collection[str]) -> dict[str, int]:
        names = self._running.pids.keys() - set(but)
        setups = {name: self._setups / f"{name}.json" for name in names}
        held = {name for name, file in setups.items() if file.exists() and is_held(file)}
        return {name: pid for name, pid in self._running.pids.items() if name in held}

    def _say(self, message: ToSupervisor, *descriptors: int) -> bool:
        try:
            socket.send_fds(self._end, [ENCODER.encode(message)], descriptors)
        except OSError as error:
            # Anything else is a supervisor that stands still: it is said again.
            if error.errno in _GONE:
                self.alone = True
            return False
        return True

    def _hear(self, *, wait_s: float = 0.0) -> None:
        if wait_s:
            select.select([self._end], [], [], wait_s)
        while True:
            try:
                data = self._end.recv(MOST_BYTES)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                self.alone = True
                return
            self._take(_decoder.decode(data))

    def _take(self, message: ToOrchestrator) -> None:
        match message:
            case Running():
                self._running = message
            case Interrupt():
                leave_closed_terminal()  # its signal need not reach us
                self._told_to_end = True
            case Stopped():
                self._stopped.append(message)
