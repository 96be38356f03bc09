"""The supervisor's end of the line to the orchestrator that it forked."""

from __future__ import annotations

import contextlib
import socket

import msgspec

from foretwin.orchestrator.drive.supervision import (
    ENCODER,
    MOST_BYTES,
    Interrupt,
    Running,
    Stopped,
    ToOrchestrator,
    ToSupervisor,
    taken_over,
)

_decoder = msgspec.msgpack.Decoder(ToSupervisor)


class OrchestratorLink:
    """The supervisor's side."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end
        self._told: Running | None = None
        self._interrupted = False
        self.standing = b""
        """What the next orchestrator goes on from."""

    def fileno(self) -> int:
        """Return the descriptor to wait at."""
        return self._end.fileno()

    def hear(self) -> list[ToSupervisor]:
        """Return what the orchestrator has said since; `standing` is then what came last."""
        said: list[ToSupervisor] = []
        with contextlib.suppress(OSError):  # nothing more, or it is gone: its end tells that
            while (received := socket.recv_fds(self._end, MOST_BYTES, 1))[0]:
                data, descriptors, _, _ = received
                for descriptor in descriptors:
                    self.standing = taken_over(descriptor)
                said.append(_decoder.decode(data))
        return said

    def tell(self, now: Running) -> None:
        """Say how the processes are, where that is news."""
        if now != self._told and self._say(now):
            self._told = now

    def interrupt(self) -> None:
        """Say once that the drive shall end."""
        if not self._interrupted:
            self._interrupted = self._say(Interrupt())

    def stopped(self, killed: list[str]) -> None:
        """Say that all processes have ended."""
        self._end.setblocking(True)
        self._say(Stopped(killed))
        self._end.setblocking(False)

    def close(self) -> None:
        """Let go of the socket."""
        self._end.close()

    def _say(self, message: ToOrchestrator) -> bool:
        try:
            self._end.send(ENCODER.encode(message))
        except OSError:
            return False
        return True


def linked() -> tuple[socket.socket, socket.socket]:
    """Return the supervisor's and the orchestrator's end of a new pair of sockets."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (here, there):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_BYTES)
    return here, there
