"""Hears what libraries say on this process's own standard output, record by record.

Each write is a record, so that nobody whose text stands in one can begin another. Who writes waits
for nothing but this process itself: no disk and no terminal. Where records come faster than they
can be looked at, all are let go for a moment.
"""

from __future__ import annotations

import os
import socket
import threading
import time
import traceback
from collections.abc import Callable

from foretwin.contracts.terminal import say

_STDOUT = 1
_HOLDS_BYTES = 1 << 20
"""What may wait to be looked at; the system may give less."""
_MOST_AT_ONCE = 1000
_BURST, _PER_S, _AFTER_FLOOD = 20_000, 10_000, 1000
"""So many records at a stretch, and each second, are looked at; more are a flood. A process that
was started again and asks for what it missed makes thousands at once."""
_BEHIND_S = 0.5
"""Who writes waits no longer for looks that do not catch up."""
_LOOK_S = 0.02
_LET_GO_S = 0.5
_MOST_BYTES = 1024
"""Of one record; the rest of it says nothing more."""


class OwnLog:
    """Gives each record to `take`, in a thread of its own, until `close`; `gap` says that some are
    missing. Errors of theirs end the hearing, not the process."""

    def __init__(self, take: Callable[[bytes], object], gap: Callable[[], object]) -> None:
        self._take, self._gap = take, gap
        self._heard, self._said = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._said.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _HOLDS_BYTES)
        self._nowhere = os.open(os.devnull, os.O_WRONLY | os.O_CLOEXEC)
        self._closed = threading.Event()
        os.dup2(self._said.fileno(), _STDOUT)
        self._thread = threading.Thread(target=self._hear, name="own-log", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Look at what was said until now, and let go what comes after it."""
        self._closed.set()
        self._thread.join()

    def _hear(self) -> None:
        fault = ""
        try:
            left, taken = float(_BURST), 0
            looked_s = caught_up_s = time.monotonic()
            while not self._closed.wait(_LOOK_S if taken < _MOST_AT_ONCE else 0.0):
                now_s = time.monotonic()
                left, looked_s = min(_BURST, left + _PER_S * (now_s - looked_s)), now_s
                taken = self._look()
                left -= taken
                if taken < _MOST_AT_ONCE:
                    caught_up_s = time.monotonic()
                if left < 0 or time.monotonic() - caught_up_s > _BEHIND_S:
                    self._let_go()
                    left, taken = float(_AFTER_FLOOD), 0
                    looked_s = caught_up_s = time.monotonic()
            self._look()
        except Exception:
            fault = traceback.format_exc()
        os.dup2(self._nowhere, _STDOUT)
        self._drain()  # nobody may wait for us
        if fault:
            say(f"hears its own log no more: {fault}", error=True)

    def _look(self) -> int:
        """Take what is there, of much a part; returns how many records that were."""
        for taken in range(_MOST_AT_ONCE):
            try:
                record = self._heard.recv(_MOST_BYTES, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return taken
            self._take(record)
        return _MOST_AT_ONCE

    def _let_go(self) -> None:
        os.dup2(self._nowhere, _STDOUT)
        self._drain()
        self._gap()
        self._closed.wait(_LET_GO_S)
        os.dup2(self._said.fileno(), _STDOUT)

    def _drain(self) -> None:
        try:
            while True:
                self._heard.recv(_MOST_BYTES, socket.MSG_DONTWAIT)
        except BlockingIOError:
            pass
