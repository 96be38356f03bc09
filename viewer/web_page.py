"""Rerun's page for a browser, kept to this machine: the browser itself refuses all else.

Rerun 0.41's page asks tel.rerun.io, api.github.com and app.rerun.io, and fetches fonts. Nothing in
it turns that off, so the page is handed on with a policy that allows this machine alone.
"""

from __future__ import annotations

import http.client
import http.server
import shutil
import threading
import urllib.parse

from foretwin.contracts.ports import LOOPBACK

_HANDED_ON = "Content-Type", "Content-Encoding", "Content-Length"
TIMEOUT_S = 30.0


def policy(grpc_port: int) -> str:
    """Return the Content-Security-Policy under which the page reaches `grpc_port` of this machine
    and whence it came, and nobody else."""
    data = f"http://{LOOPBACK}:{grpc_port}"
    return "; ".join(
        (
            "default-src 'self'",
            "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:",
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "worker-src 'self' blob:",
            f"connect-src 'self' data: blob: {data}",
            "frame-ancestors 'self'",
        )
    )


class PageServer:
    """Hands on the page that Rerun serves on `rerun_port`, on `port` of this machine alone."""

    def __init__(self, port: int, *, rerun_port: int, grpc_port: int) -> None:
        """Begin to serve; raises OSError where the port is taken."""
        data = urllib.parse.quote(f"rerun+http://{LOOPBACK}:{grpc_port}/proxy", safe="")
        start, allowed = f"/?url={data}", policy(grpc_port)

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if self.path == "/":
                    self.send_response(302)
                    self.send_header("Location", start)
                    self.send_header("Content-Length", "0")
                    self.end_headers()
                    return
                _hand_on(self, rerun_port, allowed)

            def log_message(self, *_: object) -> None:
                """Say nothing: every file would be a line."""

        self._server = http.server.ThreadingHTTPServer((LOOPBACK, port), Handler)
        self.address = f"http://{LOOPBACK}:{self._server.server_address[1]}/"
        threading.Thread(target=self._server.serve_forever, name="page", daemon=True).start()

    def close(self) -> None:
        """Serve no more."""
        self._server.shutdown()
        self._server.server_close()


def _hand_on(request: http.server.BaseHTTPRequestHandler, port: int, allowed: str) -> None:
    upstream = http.client.HTTPConnection(LOOPBACK, port, timeout=TIMEOUT_S)
    try:
        names = ("Accept-Encoding",)
        headers = {name: request.headers[name] for name in names if name in request.headers}
        upstream.request("GET", request.path, headers=headers)
        answer = upstream.getresponse()
        request.send_response(answer.status)
        for name in _HANDED_ON:
            if (value := answer.getheader(name)) is not None:
                request.send_header(name, value)
        request.send_header("Content-Security-Policy", allowed)
        request.send_header("Referrer-Policy", "no-referrer")
        request.end_headers()
        shutil.copyfileobj(answer, request.wfile)
    except (OSError, http.client.HTTPException):
        request.close_connection = True  # the page, or Rerun, is gone
    finally:
        upstream.close()
