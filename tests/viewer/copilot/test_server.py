"""What the server answers, and to whom it answers nothing."""

from __future__ import annotations

import asyncio
import re
import socket
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from importlib import resources
from typing import Any

import httpx
import msgspec
import pytest
from starlette.applications import Starlette

from foretwin.contracts.marks import MOST_NOTE, MarkReply
from foretwin.contracts.ports import LOOPBACK, free_port
from foretwin.viewer.colours import CRITICAL
from foretwin.viewer.copilot.feed import MOST_PAGES, Feed
from foretwin.viewer.copilot.server import (
    MOST_BODY,
    CannotError,
    ChangeAsked,
    CopilotServer,
    MarkAsked,
    PageActions,
    page_app,
)
from tests.contracts.bus_sides import DEADLINE_S

KEY = "k3y"


class Page:
    """Asks an application without a socket."""

    def __init__(self, app: Starlette) -> None:
        self._app = app

    def get(self, path: str) -> httpx.Response:
        return self._ask("GET", path)

    def post(self, path: str, **sent: Any) -> httpx.Response:
        return self._ask("POST", path, **sent)

    def _ask(self, how: str, path: str, **sent: Any) -> httpx.Response:
        async def asked() -> httpx.Response:
            transport = httpx.ASGITransport(app=self._app)
            async with httpx.AsyncClient(transport=transport, base_url="http://page") as client:
                return await client.request(how, path, **sent)

        return asyncio.run(asked())


class Actions:
    """Keeps what it was asked for."""

    def __init__(self) -> None:
        self.marked: list[MarkAsked] = []
        self.changed: list[ChangeAsked] = []

    def frame_at(self, drive_s: float | None) -> bytes:
        if drive_s is not None:
            raise CannotError("this is no recording")
        return b'{"drive_s": 1.5}'

    def plan_of(self, world_id: str) -> bytes | None:
        return b'{"world_id": "w1"}' if world_id == "w1" else None

    def mark(self, asked: MarkAsked) -> MarkReply:
        self.marked.append(asked)
        return MarkReply(mark_id="m1", stamp_ns=7, drive_time_s=1.5, count=1)

    def change(self, asked: ChangeAsked) -> str:
        self.changed.append(asked)
        if asked.value == "wrong":
            raise CannotError("must be twin")
        return "role.ego: all -> twin"

    def all(self, *, may_change: bool = True) -> PageActions:
        change = self.change if may_change else None
        return PageActions(self.frame_at, self.plan_of, self.mark, change)


@pytest.fixture
def actions() -> Actions:
    return Actions()


@pytest.fixture
def page(actions: Actions) -> Page:
    return Page(page_app(KEY, Feed(), actions.all(), about={"run": "r1"}))


def test_the_page_and_all_that_it_names_is_packed_and_served(page: Page) -> None:
    html = page.get(f"/{KEY}/")
    assert html.status_code == 200
    named = re.findall(r'(?:src|href)="([^"#]+)"', html.text)
    assert set(named) == {"icon.svg", "colours.css", "copilot.css", "copilot.js"}
    script = page.get(f"/{KEY}/copilot.js").text
    named += re.findall(r'from "\./([^"]+)"', script)
    for name in named:
        assert page.get(f"/{KEY}/{name}").status_code == 200, name
    red, green, blue = CRITICAL
    assert f"--danger: rgb({red} {green} {blue});" in page.get(f"/{KEY}/colours.css").text


def test_nothing_of_the_page_names_another_place() -> None:
    static = resources.files("foretwin.viewer.copilot") / "static"
    for file in static.iterdir():
        text = file.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?:|//[a-z]+\.|@import|url\(", text), file.name


def test_without_its_key_there_is_nothing(page: Page, actions: Actions) -> None:
    for path in ("/", "/wrong/", "/wrong/frame", "/wrong/events", "/k3y2/about", "/frame"):
        assert page.get(path).status_code == 404, path
    assert page.post("/wrong/mark", json={}).status_code == 404
    assert actions.marked == []


def test_nothing_of_another_origin_is_let_in(page: Page) -> None:
    headers = page.get(f"/{KEY}/").headers
    assert "default-src 'none'" in headers["content-security-policy"]
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"
    assert "access-control-allow-origin" not in headers


def test_frames_plans_and_what_it_is_about(page: Page) -> None:
    assert page.get(f"/{KEY}/frame").json() == {"drive_s": 1.5}
    assert page.get(f"/{KEY}/frame?at=3").status_code == 409
    assert page.get(f"/{KEY}/frame?at=x").status_code == 400
    assert page.get(f"/{KEY}/plan/w1").json() == {"world_id": "w1"}
    assert page.get(f"/{KEY}/plan/w2").status_code == 404
    assert page.get(f"/{KEY}/about").json() == {"run": "r1", "may_change": True}


def test_marks_are_handed_on(page: Page, actions: Actions) -> None:
    said = page.post(f"/{KEY}/mark", json={"note": "tram", "mark_id": "m1", "stamp_ns": 7})
    assert said.json() == {"mark_id": "m1", "stamp_ns": 7, "drive_time_s": 1.5, "count": 1}
    assert actions.marked == [MarkAsked(note="tram", mark_id="m1", stamp_ns=7)]


@pytest.mark.parametrize(
    "body",
    [
        b"no json",
        b'{"another": 1}',
        msgspec.json.encode({"note": "x" * (MOST_NOTE + 1)}),
        msgspec.json.encode({"by": "x" * 61}),
        b'{"note": "' + b"x" * MOST_BODY + b'"}',
    ],
)
def test_what_is_no_mark_is_refused(page: Page, actions: Actions, body: bytes) -> None:
    sent = {"content": body, "headers": {"content-type": "application/json"}}
    assert page.post(f"/{KEY}/mark", **sent).status_code == 400
    assert page.post(f"/{KEY}/mark", content=b"{}").status_code == 400, "no form of another page"
    assert page.get(f"/{KEY}/mark").status_code == 404
    assert actions.marked == []


def test_the_clock_by_which_frames_are_made_can_be_asked(page: Page) -> None:
    before_s = time.monotonic()
    told_s = page.get(f"/{KEY}/clock").json()["now_s"]
    assert before_s - 0.001 <= told_s <= time.monotonic() + 0.001
    assert page.get("/another/clock").status_code == 404


def test_roles_are_changed_by_who_may(page: Page, actions: Actions) -> None:
    asked = {"key": "role.ego", "value": "twin"}
    assert page.post(f"/{KEY}/change", json=asked).json() == {"text": "role.ego: all -> twin"}
    wrong = page.post(f"/{KEY}/change", json=asked | {"value": "wrong"})
    assert (wrong.status_code, wrong.text) == (409, "must be twin\n")
    seat = Page(page_app(KEY, Feed(), actions.all(may_change=False), about={}))
    refused = seat.post(f"/{KEY}/change", json=asked)
    assert (refused.status_code, refused.text) == (409, "nothing can be changed from this seat\n")
    assert not seat.get(f"/{KEY}/about").json()["may_change"]
    assert len(actions.changed) == 2


@pytest.fixture
def server(actions: Actions) -> Iterator[CopilotServer]:
    port = free_port()
    made = CopilotServer(
        lambda feed: page_app(KEY, feed, actions.all(), about={}), host=LOOPBACK, port=port
    )
    made.port = port
    made.start()
    yield made
    made.close(DEADLINE_S)


def listen(server: CopilotServer) -> tuple[HTTPConnection, Iterator[str]]:
    connection = HTTPConnection(LOOPBACK, server.port, timeout=DEADLINE_S)
    connection.request("GET", f"/{KEY}/events")
    answer = connection.getresponse()
    assert answer.headers["content-type"].startswith("text/event-stream")

    def data() -> Iterator[str]:
        while text := answer.fp.readline():
            if text.startswith(b"data: "):
                yield text[6:].decode().strip()

    return connection, data()


def wait_for(server: CopilotServer, pages: int) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while server.pages != pages:
        assert time.monotonic() < deadline_s


def test_over_a_socket_a_frame_is_there_at_once_and_a_frozen_page_holds_up_nobody(
    server: CopilotServer,
) -> None:
    frozen = socket.create_connection((LOOPBACK, server.port), timeout=DEADLINE_S)
    frozen.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    frozen.sendall(f"GET /{KEY}/events HTTP/1.1\r\nHost: x\r\n\r\n".encode())
    connection, frames = listen(server)
    wait_for(server, 2)
    padding = "x" * 20_000
    for number in range(400):  # 8 MB, more than any socket holds
        server.publish(msgspec.json.encode([number, padding]))
        if number % 40 == 0:
            assert msgspec.json.decode(next(frames))[0] <= number
    newest = next(one for one in frames if msgspec.json.decode(one)[0] == 399)
    assert newest
    frozen.close()
    connection.close()


def test_a_frame_goes_out_with_when_it_was_made(server: CopilotServer) -> None:
    connection = HTTPConnection(LOOPBACK, server.port, timeout=DEADLINE_S)
    connection.request("GET", f"/{KEY}/events")
    lines = connection.getresponse().fp
    wait_for(server, 1)

    before_s = time.monotonic()
    server.publish(b"1")
    now_s = next(float(line[4:]) for line in lines if line.startswith(b"id: "))
    assert before_s - 0.001 <= now_s <= time.monotonic() + 0.001
    server.publish(b"2", 7.5)
    assert next(line for line in lines if line.startswith(b"id: ")) == b"id: 7.500\n"
    connection.close()


def test_the_last_frame_reaches_a_page_before_the_server_is_gone(server: CopilotServer) -> None:
    connection, frames = listen(server)
    wait_for(server, 1)
    server.publish(b'"ended"')
    server.close(DEADLINE_S)
    assert list(frames)[-1] == '"ended"'
    connection.close()
    server.publish(b'"nobody is there"')


def test_a_port_that_is_taken_is_said(server: CopilotServer, actions: Actions) -> None:
    another = CopilotServer(
        lambda feed: page_app(KEY, feed, actions.all(), about={}), host=LOOPBACK, port=server.port
    )
    with pytest.raises(OSError, match=f"cannot listen at 127.0.0.1:{server.port}"):
        another.start()


def test_pages_beyond_all_seats_are_turned_away(server: CopilotServer) -> None:
    open_ones = []
    for number in range(MOST_PAGES):
        open_ones.append(listen(server)[0])
        wait_for(server, number + 1)
    connection = HTTPConnection(LOOPBACK, server.port, timeout=DEADLINE_S)
    connection.request("GET", f"/{KEY}/events")
    assert connection.getresponse().status == 503
    for one in (*open_ones, connection):
        one.close()
