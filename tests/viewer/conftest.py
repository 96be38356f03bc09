"""A run's bus and a viewer process on it."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.bus import Mailbox, ZenohBus
from foretwin.contracts.codec import write_message
from foretwin.contracts.keys import alive_key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.segments import Roll
from foretwin.contracts.setup import BusSetup, ViewerSetup, write_setup
from tests.contracts.bus_sides import DEADLINE_S
from tests.viewer import scene

RUN = "run1"
VEHICLE = "car"
VEHICLE_CHANNELS = ("state", "gnss", "plan", "end")


def wait_until(condition: Callable[[], bool], *, timeout_s: float = DEADLINE_S) -> None:
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, "the condition did not come true in time"
        time.sleep(0.01)


class ViewerRun:
    """A router that plays the orchestrator, and one viewer process."""

    def __init__(
        self,
        folder: Path,
        *,
        live: str = "none",
        start_stamp_ns: int = scene.START_NS,
        roll: Roll | None = None,
        grace_s: float = 5.0,
    ) -> None:
        self.recording = folder / "monitor.rrd"
        self.log = folder / "log.jsonl"
        worlds = folder / "worlds"
        worlds.mkdir()
        write_message(scene.junction(), worlds / f"{scene.WORLD_ID}.world")
        bus_setup = BusSetup(endpoint=free_endpoint(), lossless=True)
        self.bus = ZenohBus(bus_setup, router=True)
        setup = ViewerSetup(
            run_id=RUN,
            process_id="viewer",
            vehicle_id=VEHICLE,
            bus=bus_setup,
            log_file=str(self.log),
            grace_s=grace_s,
            file=str(self.recording),
            worlds_dir=str(worlds),
            drive_frame=scene.DRIVE_FRAME,
            live=live,
            roll=roll or Roll(),
            title="hand-made drive",
            start_stamp_ns=start_stamp_ns,
        )
        write_setup(setup, folder / "viewer.json")
        alive = Mailbox(8)
        self.bus.watch_alive(alive_key(run=RUN, process="viewer"), alive)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "foretwin.viewer", "--setup", str(folder / "viewer.json")]
        )
        assert alive.take(DEADLINE_S) is not None, "the viewer never said that it is ready"

    def send(self, messages: Iterator[scene.Message]) -> None:
        for channel, message in messages:
            ids = {"vehicle": VEHICLE} if channel in VEHICLE_CHANNELS else {"run": RUN}
            self.bus.publish(channel, message, **ids)

    def logged(self, text: str) -> bool:
        return self.log.exists() and text in self.log.read_text()

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.bus.close()


@pytest.fixture
def start_viewer(tmp_path: Path) -> Iterator[Callable[..., ViewerRun]]:
    """Start a viewer process that ends with the test."""
    runs: list[ViewerRun] = []

    def start(**how: Any) -> ViewerRun:
        runs.append(ViewerRun(tmp_path, **how))
        return runs[-1]

    yield start
    for run in runs:
        run.close()
