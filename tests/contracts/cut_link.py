"""A link that can be cut or slowed down: a TCP proxy on the loopback interface, for an endpoint."""

from __future__ import annotations

import contextlib
import socket
import threading
from typing import Self

from foretwin.contracts.ports import LOOPBACK, free_port


class CutLink:
    """Passes bytes between clients and `endpoint` until `cut`; use it as a context."""

    def __init__(self, endpoint: str) -> None:
        self._port, self._target = free_port(), int(endpoint.rsplit(":", 1)[1])
        self._listener = socket.create_server((LOOPBACK, self._port))
        self._ends: list[socket.socket] = []
        self._whole = True
        self.delay_s = 0.0
        """How long what is on its way waits, both ways."""
        self._lock, self._pause = threading.Lock(), threading.Event()
        self._threads = [threading.Thread(target=self._accept, daemon=True)]

    @property
    def endpoint(self) -> str:
        """Where clients connect."""
        return f"tcp/{LOOPBACK}:{self._port}"

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(self, *what: object) -> None:
        self.cut()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for thread in self._threads:
            thread.join()

    def cut(self) -> None:
        """End all connections and take no new ones."""
        with self._lock:
            self._whole = False
            ends, self._ends = self._ends, []
        for end in ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def mend(self) -> None:
        """Take connections again."""
        self._whole = True

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            with self._lock:
                if not self._whole:
                    near.close()
                    continue
                try:
                    far = socket.create_connection((LOOPBACK, self._target))
                except OSError:  # the router is being started again
                    near.close()
                    continue
                self._ends += [near, far]
            both = [
                threading.Thread(target=self._pass_on, args=pair, daemon=True)
                for pair in ((near, far), (far, near))
            ]
            closing = threading.Thread(target=_close_after, args=(both, near, far), daemon=True)
            self._threads += [*both, closing]
            for thread in (*both, closing):
                thread.start()

    def _pass_on(self, source: socket.socket, target: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                if self.delay_s:
                    self._pause.wait(self.delay_s)
                target.sendall(data)
        for end in (source, target):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)


def _close_after(threads: list[threading.Thread], *ends: socket.socket) -> None:
    for thread in threads:
        thread.join()
    for end in ends:
        end.close()
