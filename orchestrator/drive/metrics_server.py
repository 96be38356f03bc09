"""Tells a drive's metrics to who asks over HTTP, as Prometheus' text, without a word in between.

A thread of its own answers. What it tells is read by the drive's loop, at its next turn: nobody
reads beside it what it changes, and a loop that hangs tells nothing.
"""

from __future__ import annotations

import contextlib
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from socketserver import TCPServer
from typing import Any

from foretwin.contracts.errors import UserError
from foretwin.contracts.ports import metrics_place
from foretwin.orchestrator.drive.operator_metrics import MetricSample, exposition, process_samples

TYPE = "text/plain; version=0.0.4; charset=utf-8"
ANSWER_S = 2.0
"""So long may the drive's loop take to say what everything is."""
CLIENT_S = 5.0
"""So long may who asks take over it, all in all: the end of a drive waits for it."""


@contextlib.contextmanager
def listening(place: str | None) -> Iterator[socket.socket | None]:
    """Listen at the place that `--metrics` names, for whoever answers in this process's forks.

    Raises UserError where that cannot be.
    """
    if place is None:
        yield None
        return
    at = metrics_place(place)
    with socket.socket() as listener:
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(at)
            listener.listen()
        except OSError as error:
            why = (error.strerror or str(error)).lower()
            raise UserError(f"--metrics {place}: nothing can listen there: {why}") from error
        yield listener


class MetricsServer:
    """Answers `GET /metrics` at a socket that listens; the drive's loop calls `look` often."""

    def __init__(
        self,
        listener: socket.socket,
        read: Callable[[float], list[MetricSample]],
        *,
        processes: Path,
    ) -> None:
        self._read, self._processes = read, processes
        self._asked, self._told = threading.Event(), threading.Event()
        self._samples: list[MetricSample] = []
        self._server = _Server(listener.getsockname(), _handler(self.page), bind_and_activate=False)
        self._server.socket.close()
        self._server.socket = listener
        self._thread = threading.Thread(
            target=self._server.serve_forever, name="metrics", daemon=True
        )
        self._thread.start()

    def look(self, now_s: float) -> None:
        """Say what everything is, where somebody asks."""
        if self._asked.is_set():
            self._asked.clear()
            self._samples = self._read(now_s)
            self._told.set()

    def page(self) -> str | None:
        """Return the metrics as text, None where the drive's loop does not answer in time."""
        self._told.clear()
        self._asked.set()
        if not self._told.wait(ANSWER_S):
            return None
        return exposition([*self._samples, *process_samples(self._processes)])

    def close(self) -> None:
        """Answer nobody any more; the socket still listens."""
        self._server.shutdown()
        self._thread.join()


@contextlib.contextmanager
def told_metrics(
    listener: socket.socket | None, read: Callable[[float], list[MetricSample]], *, processes: Path
) -> Iterator[Callable[[float], None]]:
    """Tell metrics while the block goes on; gives what the loop calls often.

    Without a socket nothing is told.
    """
    if listener is None:
        yield lambda _: None
        return
    server = MetricsServer(listener, read, processes=processes)
    try:
        yield server.look
    finally:
        server.close()


class _Server(TCPServer):
    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing on the drive's screen of who hung up, or was hung up on."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


def _handler(page: Callable[[], str | None]) -> type[BaseHTTPRequestHandler]:
    class MetricsRequest(BaseHTTPRequestHandler):
        server_version, sys_version = "foretwin", ""

        def setup(self) -> None:
            super().setup()
            # A `timeout` is of each word alone: who says one now and then would stay for ever.
            self._let_go = threading.Timer(CLIENT_S, self._hang_up)
            self._let_go.start()

        def finish(self) -> None:
            self._let_go.cancel()
            super().finish()

        def _hang_up(self) -> None:
            with contextlib.suppress(OSError):  # who asked is gone
                self.connection.shutdown(socket.SHUT_RDWR)

        def do_GET(self) -> None:
            if self.path.partition("?")[0] != "/metrics":
                self.send_error(404, "only /metrics is told")
                return
            told = page()
            if told is None:
                self.send_error(503, "the drive does not answer")
                return
            data = told.encode()
            self.send_response(200)
            self.send_header("Content-Type", TYPE)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: Any) -> None:
            """Say nothing: who watches asks for ever."""

    return MetricsRequest
