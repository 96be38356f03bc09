"""The Rerun program itself: found, started on this machine's own address, and ended."""

from __future__ import annotations

import importlib.util
import logging
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.ends_with_parent import ends_with_parent
from foretwin.contracts.ports import LOOPBACK, WEB_PORT, free_port
from foretwin.contracts.terminal import say
from foretwin.viewer.web_page import PageServer

HOST = LOOPBACK
PORT = 9876
START_S = 60.0
LIVE_CHOICES = ("native", "web", "none")

_log = logging.getLogger(__name__)


class NoViewerError(ValueError):
    """No viewer can be shown as asked; the message says what would work."""


def address(port: int) -> str:
    """Return the address at which a viewer on this machine takes recordings."""
    return f"rerun+http://{HOST}:{port}/proxy"


def rerun_program() -> Path:
    """Return the Rerun binary itself: the `rerun` script is a wrapper that signals do not pass."""
    spec = importlib.util.find_spec("rerun_cli")
    folders = [] if spec is None else list(spec.submodule_search_locations or [])
    for folder in folders:
        for name in ("rerun", "rerun.exe", "Rerun.app/Contents/MacOS/Rerun"):
            path = Path(folder) / name
            if path.is_file():
                return path
    raise NoViewerError("the rerun program is missing; install the package rerun-sdk again")


def has_display() -> bool:
    """Return whether a window can be opened; only Linux says so in the environment."""
    names = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
    return not sys.platform.startswith("linux") or any(os.environ.get(name) for name in names)


def answers(port: int) -> bool:
    """Return whether something listens on `port` of this machine."""
    with socket.socket() as probe:
        probe.settimeout(0.5)
        return probe.connect_ex((HOST, port)) == 0


def wait_until_it_answers(process: subprocess.Popen[bytes], port: int) -> None:
    """Return once `process` listens on `port`; raises NoViewerError when it ends or is slow."""
    deadline = time.monotonic() + START_S
    while not answers(port):
        if process.poll() is not None:
            raise NoViewerError(
                f"the viewer ended with code {process.returncode}; is there a display?"
            )
        if time.monotonic() > deadline:
            raise NoViewerError(f"the viewer did not listen on port {port} within {START_S:.0f} s")
        time.sleep(0.05)


def offline_environment() -> dict[str, str]:
    """Return an environment in which Rerun reaches this machine alone.

    Rerun 0.41 asks api.github.com for updates, sends statistics to tel.rerun.io and, in a map
    view, fetches tiles, which tells where the car is. A proxy that nobody serves stops all three.
    """
    nowhere = f"http://{HOST}:9"
    names = ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY")
    return {
        **os.environ,
        **{name: nowhere for upper in names for name in (upper, upper.lower())},
        "NO_PROXY": f"{HOST},localhost",
        "no_proxy": f"{HOST},localhost",
        "RERUN_APP_ONLY": "true",
    }


def start_program(*arguments: str, port: int, outlives: bool = False) -> subprocess.Popen[bytes]:
    """Start Rerun listening on `port` of this machine alone, in a session of its own.

    Unless it `outlives` the thread that has started it, it ends with that, whatever ends it.
    """
    command = [str(rerun_program()), "--bind", HOST, "--port", str(port), *arguments]
    return subprocess.Popen(
        command if outlives else ends_with_parent(command, parent=os.getpid()),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=offline_environment(),
        start_new_session=True,
    )


class WebViewer(NamedTuple):
    """Rerun as a server for browsers: its process, its page, and the port that takes rows."""

    process: subprocess.Popen[bytes]
    page: PageServer
    port: int


class LiveViewer(NamedTuple):
    """How a live viewer is reached: `open()` starts it if need be, `end(keep_window)` ends it.

    What was not started here is left alone. A native window may outlive the run, for the engineer
    to look at; a web server never does.
    """

    open: Callable[[], str]
    end: Callable[[bool], None]


def start_web(*recordings: str, page_port: int = 0) -> WebViewer:
    """Serve Rerun for browsers of this machine: what is sent to it, or recordings.

    The page is at `page_port`, or at a free port where that is taken or 0. Raises NoViewerError.
    """
    port, rerun_port = free_port(), free_port()
    process = start_program(
        *recordings, "--serve-web", "--web-viewer-port", str(rerun_port), port=port
    )
    wait_until_it_answers(process, port)
    wait_until_it_answers(process, rerun_port)
    try:
        page = PageServer(page_port, rerun_port=rerun_port, grpc_port=port)
    except OSError:
        page = PageServer(0, rerun_port=rerun_port, grpc_port=port)
    return WebViewer(process, page, port)


def serve_recordings(recordings: Sequence[Path]) -> None:
    """Serve recordings for browsers of this machine until Ctrl-C, and say where."""
    web = start_web(*map(str, recordings), page_port=WEB_PORT)
    try:
        say(f"view: {web.page.address} (Ctrl-C ends it)")
        web.process.wait()
    except KeyboardInterrupt:
        pass
    finally:
        web.process.terminate()
        web.process.wait()


def live_viewer(live: str, *, page_port: int = WEB_PORT) -> LiveViewer | None:
    """Return the live viewer for `live`, one of native, web, none, or an address; the page of web
    is at `page_port`.

    Raises NoViewerError for anything else.
    """
    if live == "none":
        return None
    if live.startswith(("rerun://", "rerun+http://", "rerun+https://")):
        return LiveViewer(lambda: live, lambda _keep: None)
    if live not in LIVE_CHOICES:
        raise NoViewerError(
            f"live view {live!r} must be {', '.join(LIVE_CHOICES)} or an address rerun+http://…/proxy"
        )
    started: list[subprocess.Popen[bytes]] = []

    def open_native() -> str:
        # Without a display, the program still listens for a moment before it gives up.
        if not has_display():
            raise NoViewerError("there is no display for the native viewer")
        if not answers(PORT):
            process = start_program(
                "--hide-welcome-screen", "--expect-data-soon", port=PORT, outlives=True
            )
            started.append(process)
            wait_until_it_answers(process, PORT)
        return address(PORT)

    def open_web() -> str:
        web = start_web(page_port=page_port)
        started.append(web.process)
        _log.info("web view: %s", web.page.address)
        return address(web.port)

    def end(keep_window: bool) -> None:
        if live == "web" or not keep_window:
            for process in started:
                process.terminate()

    return LiveViewer(open_native if live == "native" else open_web, end)
