"""What the display's server answers: a packed page, its frames, Worlds, marks and changes."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import threading
import time
from collections.abc import Awaitable, Callable
from importlib import resources
from typing import Any, NamedTuple

import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route

from foretwin.contracts.campaign import TlsFiles
from foretwin.contracts.marks import MOST_NOTE
from foretwin.viewer.colours import PAGE
from foretwin.viewer.copilot.feed import MOST_PAGES, Feed

START_S = 20.0
MOST_BODY = 8192
"""Bytes of what a page sends."""
MOST_NAME = 60
_FILES = {
    "": ("index.html", "text/html"),
    "copilot.css": ("copilot.css", "text/css"),
    "copilot.js": ("copilot.js", "text/javascript"),
    "drawing.js": ("drawing.js", "text/javascript"),
    "sound.js": ("sound.js", "text/javascript"),
    "icon.svg": ("icon.svg", "image/svg+xml"),
}
_HEADERS = {
    # Nothing of another origin is loaded, asked or told, whatever a text holds.
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class MarkAsked(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a page sends to mark an event; with `mark_id` and `stamp_ns` a note to one."""

    note: str = ""
    by: str = ""
    mark_id: str | None = None
    stamp_ns: int | None = None


class ChangeAsked(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a page sends to change the running drive, as `foretwin set` does."""

    key: str
    value: str


class CannotError(RuntimeError):
    """What was asked for cannot be done; the message says why in one line."""


class PageActions(NamedTuple):
    """What a page may ask for, each called in a thread of its own.

    They raise CannotError. `change` is None where nobody may change anything here.
    """

    frame_at: Callable[[float | None], bytes]
    """The frame at a drive time, of a recording; without one the newest."""
    plan_of: Callable[[str], bytes | None]
    mark: Callable[[MarkAsked], Any]
    change: Callable[[ChangeAsked], str] | None = None


def colours_css() -> str:
    """Return the colours that all views share, as variables of the style sheet."""
    lines = (f"--{name}: rgb({r} {g} {b});" for name, (r, g, b) in PAGE.items())
    return ":root {" + " ".join(lines) + "}\n"


def page_app(key: str, feed: Feed, actions: PageActions, *, about: dict[str, Any]) -> Starlette:
    """Return the application; every path begins with `key`, without which nothing is answered."""
    files = resources.files("foretwin.viewer.copilot") / "static"
    held = {name: ((files / file).read_bytes(), kind) for name, (file, kind) in _FILES.items()} | {
        "colours.css": (colours_css().encode(), "text/css")
    }
    told = msgspec.json.encode(about | {"may_change": actions.change is not None})

    def guarded(
        answer: Callable[[Request], Awaitable[Response]],
    ) -> Callable[[Request], Awaitable[Response]]:
        async def answered(request: Request) -> Response:
            if not secrets.compare_digest(request.path_params["key"].encode(), key.encode()):
                return _said(404, "no such page")
            try:
                return await answer(request)
            except CannotError as cannot:
                return _said(409, str(cannot))
            except (msgspec.DecodeError, ValueError) as problem:
                return _said(400, str(problem))

        return answered

    async def file(request: Request) -> Response:
        found = held.get(request.path_params.get("name", ""))
        if found is None:
            return _said(404, "no such page")
        return Response(found[0], media_type=found[1], headers=_HEADERS)

    async def events(request: Request) -> Response:
        if feed.pages >= MOST_PAGES:
            return _said(503, f"{MOST_PAGES} pages are open already")
        return StreamingResponse(feed.events(), media_type="text/event-stream", headers=_HEADERS)

    async def clock(request: Request) -> Response:
        # Pages tell by it how old a frame is that waited on its way.
        return _json(b'{"now_s": %.3f}' % time.monotonic())

    async def frame(request: Request) -> Response:
        at = request.query_params.get("at")
        at_s = None if at is None else float(at)
        return _json(await run_in_threadpool(actions.frame_at, at_s))

    async def plan(request: Request) -> Response:
        found = await run_in_threadpool(actions.plan_of, request.path_params["world"])
        return _said(404, "no such World") if found is None else _json(found)

    async def mark(request: Request) -> Response:
        asked = msgspec.json.decode(await _body(request), type=MarkAsked)
        if len(asked.note) > MOST_NOTE or len(asked.by) > MOST_NAME:
            raise ValueError(f"a note has at most {MOST_NOTE} characters, a name {MOST_NAME}")
        return _json(msgspec.json.encode(await run_in_threadpool(actions.mark, asked)))

    async def change(request: Request) -> Response:
        asked = msgspec.json.decode(await _body(request), type=ChangeAsked)
        if actions.change is None:
            raise CannotError("nothing can be changed from this seat")
        text = await run_in_threadpool(actions.change, asked)
        return _json(msgspec.json.encode({"text": text}))

    async def what(request: Request) -> Response:
        return _json(told)

    app = Starlette(
        routes=[
            Route("/{key}/events", guarded(events)),
            Route("/{key}/clock", guarded(clock)),
            Route("/{key}/frame", guarded(frame)),
            Route("/{key}/about", guarded(what)),
            Route("/{key}/plan/{world}", guarded(plan)),
            Route("/{key}/mark", guarded(mark), methods=["POST"]),
            Route("/{key}/change", guarded(change), methods=["POST"]),
            Route("/{key}/", guarded(file)),
            Route("/{key}/{name}", guarded(file)),
        ]
    )
    app.router.redirect_slashes = False
    return app


async def _body(request: Request) -> bytes:
    # Pages of other origins cannot send this type without being asked first.
    if request.headers.get("content-type", "").split(";")[0] != "application/json":
        raise ValueError("must be application/json")
    data = b""
    async for part in request.stream():
        data += part
        if len(data) > MOST_BODY:
            raise ValueError(f"at most {MOST_BODY} bytes")
    return data


def _json(data: bytes) -> Response:
    return Response(data, media_type="application/json", headers=_HEADERS)


def _said(status: int, text: str) -> Response:
    return Response(f"{text}\n", status, media_type="text/plain", headers=_HEADERS)


class CopilotServer:
    """Serves an application from a thread of its own, and ends it in bounded time."""

    def __init__(
        self,
        make: Callable[[Feed], Starlette],
        *,
        host: str,
        port: int,
        tls: TlsFiles | None = None,
    ) -> None:
        self._make = make
        self._config = {"host": host, "port": port}
        self._tls = tls
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: uvicorn.Server | None = None
        self._feed: Feed | None = None
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    def start(self) -> None:
        """Listen; raises OSError where that cannot be."""
        self._thread.start()
        until_s = time.monotonic() + START_S
        while not (self._server is not None and self._server.started):
            if not self._thread.is_alive() or time.monotonic() > until_s:
                place = f"{self._config['host']}:{self._config['port']}"
                raise OSError(f"the co-pilot display cannot listen at {place}")
            self._thread.join(0.02)

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return 0 if self._feed is None else self._feed.pages

    def publish(self, frame: bytes, made_s: float | None = None) -> None:
        """Show a frame on all pages; never waits. Pages hold one for old by when it was made, of
        the monotonic clock; without that it is made now."""
        at_s = time.monotonic() if made_s is None else made_s
        self._call(lambda feed: feed.publish(frame, at_s))

    def close(self, within_s: float) -> None:
        """Let pages have the newest frame, and end; who does not take it is left."""
        self._call(lambda feed: feed.close())
        if self._server is not None:
            self._server.should_exit = True
        self._thread.join(within_s)
        if self._thread.is_alive() and self._server is not None:
            self._server.force_exit = True

    def _call(self, work: Callable[[Feed], None]) -> None:
        loop, feed = self._loop, self._feed
        if loop is not None and feed is not None:
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                loop.call_soon_threadsafe(work, feed)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except (SystemExit, OSError) as problem:  # the port is taken
            logging.getLogger("copilot").error("the page cannot be served: %s", problem)

    async def _serve(self) -> None:
        self._loop, self._feed = asyncio.get_running_loop(), Feed()
        tls: dict[str, Any] = (
            {}
            if self._tls is None
            else {"ssl_certfile": self._tls.certificate, "ssl_keyfile": self._tls.key}
        )
        config = uvicorn.Config(
            self._make(self._feed),
            **self._config,  # type: ignore[arg-type]
            **tls,
            log_config=None,
            access_log=False,
            server_header=False,
            lifespan="off",
            loop="asyncio",
            http="h11",
            ws="none",
            timeout_graceful_shutdown=1,
            timeout_keep_alive=10,
            limit_concurrency=4 * MOST_PAGES,
        )
        self._server = uvicorn.Server(config)
        await self._server.serve()
