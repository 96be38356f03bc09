"""A recorder on a bus in memory, and a clock that is moved by hand."""

from __future__ import annotations

import time
from typing import Any

from foretwin.contracts.process import ProcessLife
from foretwin.contracts.setup import BusSetup, ProcessSetup
from foretwin.telemetry.processes.recorder import RecorderProcess
from foretwin.telemetry.processes.recording import DriveRecording
from tests.contracts.memory_bus import MemoryBus


class Wall:
    """A clock that is moved by hand."""

    def __init__(self) -> None:
        self.now_s, self.each_look_s = 0.0, 0.0

    def __call__(self) -> float:
        self.now_s += self.each_look_s
        return self.now_s


SETUP = ProcessSetup(
    run_id="r1", process_id="recorder", vehicle_id="car", bus=BusSetup(endpoint=""), log_file=""
)


def recorder(
    bus: MemoryBus,
    recording: DriveRecording,
    *,
    lossless: bool = True,
    mono_s: Any = time.monotonic,
) -> RecorderProcess:
    return RecorderProcess(
        recording,
        bus=bus,
        life=ProcessLife(SETUP, bus, mono_s=mono_s),
        run_id="r1",
        vehicle_id="car",
        lossless=lossless,
        mono_s=mono_s,
    )
