"""A display's process on a real bus, fed by hand, and a page that reads its frames."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.codec import write_message
from foretwin.contracts.keys import alive_key
from foretwin.contracts.page_address import FRAMES_FILE, page_address, page_key
from foretwin.contracts.ports import LOOPBACK, free_endpoint, free_port
from foretwin.contracts.setup import BusSetup, CopilotSetup, write_setup
from foretwin.viewer.copilot.frame import PageFrame
from foretwin.viewer.copilot.server import CopilotServer, PageActions, page_app
from tests.contracts.bus_sides import DEADLINE_S
from tests.viewer import scene

RUN, VEHICLE = "run1", "car"
OF_VEHICLE = ("state", "gnss", "plan", "end", "objects", "signals", "injection")


class DisplayRun:
    """A router that plays the drive, and one display."""

    another: ZenohBus
    """Of a further process of the run, for who starts one."""

    def __init__(self, folder: Path, **settings: Any) -> None:
        self.folder = folder
        worlds = folder / "worlds"
        worlds.mkdir()
        write_message(scene.junction(), worlds / f"{scene.WORLD_ID}.world")
        bus_setup = BusSetup(endpoint=free_endpoint())
        self.bus = ZenohBus(bus_setup, router=True)
        self._alive = Mailbox(8)
        self.bus.watch_alive(alive_key(run=RUN, process="copilot"), self._alive)
        self.port = free_port()
        self.setup = CopilotSetup(
            run_id=RUN,
            process_id="copilot",
            vehicle_id=VEHICLE,
            bus=bus_setup,
            log_file=str(folder / "log.jsonl"),
            grace_s=5.0,
            port=self.port,
            worlds_dir=str(worlds),
            drive_frame=scene.DRIVE_FRAME,
            start_stamp_ns=scene.START_NS,
            frames_file=str(folder / FRAMES_FILE),
            **settings,
        )
        write_setup(self.setup, folder / "copilot.json")
        self.key = page_key(bus_setup, RUN)
        self.address = page_address(self.key, port=self.port)
        self.start()

    def start(self) -> None:
        """Start the display's process and wait until it is ready, if it tells the drive."""
        self.process = subprocess.Popen(
            [
                sys.executable,
                "-P",
                "-m",
                "foretwin.viewer.copilot",
                "--setup",
                str(self.folder / "copilot.json"),
            ],
            stdout=None if self.setup.awaited else subprocess.PIPE,
            text=True,
        )
        if not self.setup.awaited:
            return
        item = self._alive.take(DEADLINE_S)
        while item is not None and not item.up:  # the one before it is gone
            item = self._alive.take(DEADLINE_S)
        assert item is not None, "the display never said that it is ready"

    def send(self, channel: str, message: Any) -> None:
        ids = {"vehicle": VEHICLE} if channel in OF_VEHICLE else {"run": RUN}
        self.bus.publish(channel, message, **ids)

    def frames(self) -> Generator[PageFrame, None, None]:
        """Yield frames as a page gets them."""
        connection = HTTPConnection(LOOPBACK, self.port, timeout=DEADLINE_S)
        with contextlib.closing(connection):
            connection.request("GET", f"/{self.key}/events")
            with connection.getresponse() as answer:
                assert answer.status == 200
                while text := answer.fp.readline():
                    if text.startswith(b"data: "):
                        yield msgspec.json.decode(text[6:], type=PageFrame)

    def frame_where(self, holds: Callable[[PageFrame], bool]) -> PageFrame:
        """Return the first frame for which something holds."""
        deadline_s = time.monotonic() + DEADLINE_S
        with contextlib.closing(self.frames()) as frames:
            for frame in frames:
                if holds(frame):
                    return frame
                assert time.monotonic() < deadline_s, frame
        raise AssertionError("the display ended before")

    def ask(self, how: str, what: str, body: Any = None) -> tuple[int, Any]:
        connection = HTTPConnection(LOOPBACK, self.port, timeout=DEADLINE_S)
        sent = None if body is None else msgspec.json.encode(body)
        connection.request(
            how, f"/{self.key}/{what}", body=sent, headers={"Content-Type": "application/json"}
        )
        answer = connection.getresponse()
        data = answer.read()
        connection.close()
        return answer.status, msgspec.json.decode(data) if answer.status == 200 else data.decode()

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        self.bus.close()


@contextlib.contextmanager
def served_page(
    frame: Callable[[], bytes], *, plan: bytes | None = None
) -> Generator[tuple[CopilotServer, str]]:
    """Serve a page without a display's process: who sends its frames, and its address."""
    actions = PageActions(frame_at=lambda _: frame(), plan_of=lambda _: plan, mark=lambda _: None)
    port = free_port()
    server = CopilotServer(
        lambda feed: page_app("key", feed, actions, about={"attribution": "", "run": ""}),
        host=LOOPBACK,
        port=port,
    )
    server.start()
    try:
        yield server, page_address("key", port=port)
    finally:
        server.close(DEADLINE_S)
