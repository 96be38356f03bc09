"""A recorder as a real process on a real bus."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from foretwin.contracts.bus import Alive, Mailbox, ZenohBus
from foretwin.contracts.keys import alive_key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup, RecorderSetup, write_setup
from tests.contracts.bus_sides import DEADLINE_S

ORCHESTRATOR = alive_key(run="r1", process="orchestrator")
RECORDER = alive_key(run="r1", process="recorder")


@contextmanager
def recorder_process(
    folder: Path, *, lossless: bool = True
) -> Iterator[tuple[ZenohBus, Mailbox, Any]]:
    """A router with an orchestrator's token, what lands there, and a recorder that is ready."""
    setup = RecorderSetup(
        run_id="r1",
        process_id="recorder",
        vehicle_id="car",
        bus=BusSetup(endpoint=free_endpoint(), lossless=lossless),
        log_file=str(folder / "log"),
        file=str(folder / "drive.mcap"),
    )
    write_setup(setup, folder / "setup.json")
    with ZenohBus(setup.bus, router=True) as bus:
        bus.declare_alive(ORCHESTRATOR)
        landed = Mailbox(100)
        bus.watch_alive(RECORDER, landed)
        command = [sys.executable, "-m", "foretwin.telemetry.processes.recorder", "--setup"]
        process = subprocess.Popen([*command, str(folder / "setup.json")])
        try:
            alive = landed.take(DEADLINE_S)
            assert isinstance(alive, Alive)
            assert alive.up
            yield bus, landed, process
        finally:
            process.kill()
            process.wait()
