"""Rerun's page is handed on, with the policy that keeps the browser on this machine."""

from __future__ import annotations

import http.client
import http.server
import threading
from collections.abc import Iterator

import pytest

from foretwin.contracts.ports import LOOPBACK
from foretwin.viewer.web_page import PageServer, policy


class _Rerun(http.server.BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200 if self.path != "/none" else 404)
        self.send_header("Content-Type", "application/wasm")
        self.send_header("Content-Length", "4")
        self.end_headers()
        self.wfile.write(b"wasm")

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def page() -> Iterator[PageServer]:
    rerun = http.server.ThreadingHTTPServer((LOOPBACK, 0), _Rerun)
    threading.Thread(target=rerun.serve_forever, daemon=True).start()
    served = PageServer(0, rerun_port=rerun.server_address[1], grpc_port=9876)
    yield served
    served.close()
    rerun.shutdown()
    rerun.server_close()


def _get(page: PageServer, path: str) -> tuple[http.client.HTTPResponse, bytes]:
    host = page.address.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(host, timeout=10.0)
    connection.request("GET", path)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def test_the_bare_address_leads_to_the_drive(page: PageServer) -> None:
    answer, _ = _get(page, "/")
    assert answer.status == 302
    assert answer.getheader("Location") == "/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A9876%2Fproxy"


def test_what_rerun_serves_comes_with_the_policy(page: PageServer) -> None:
    for path, status in (("/re_viewer_bg.wasm", 200), ("/none", 404)):
        answer, body = _get(page, path)
        assert (answer.status, body) == (status, b"wasm")
        assert answer.getheader("Content-Type") == "application/wasm"
        assert answer.getheader("Content-Security-Policy") == policy(9876)


def test_the_policy_names_this_machine_alone() -> None:
    said = policy(1234)
    assert "connect-src 'self' data: blob: http://127.0.0.1:1234;" in said
    assert "http" not in said.replace("http://127.0.0.1:1234", "")
    assert "*" not in said
    assert "default-src 'self'" in said


def test_a_port_that_is_taken_is_an_error(page: PageServer) -> None:
    taken = int(page.address.rstrip("/").rsplit(":", 1)[1])
    with pytest.raises(OSError, match="in use"):
        PageServer(taken, rerun_port=1, grpc_port=1)
