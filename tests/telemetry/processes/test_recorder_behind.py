"""A recorder for which more comes than it writes."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import pytest

from foretwin.contracts.drive import SpeedSample
from foretwin.contracts.simulation import RunEnd
from foretwin.telemetry.processes.recording import DriveRecording
from tests.contracts.memory_bus import MemoryBus
from tests.telemetry.drive_messages import START_NS
from tests.telemetry.processes.wired_recorder import Wall, recorder


def test_who_is_behind_at_the_end_writes_what_has_come_by_then(tmp_path: Path) -> None:
    wall, bus, recording = Wall(), MemoryBus(), DriveRecording(tmp_path / "drive.mcap")
    process = recorder(bus, recording, lossless=False, mono_s=wall)
    for number in range(1200):
        bus.publish("speed", SpeedSample(stamp_ns=START_NS + number, speed_mps=1.0), vehicle="car")
    wall.each_look_s = 0.3
    process.finish()
    assert recording.tally.recorded == {"speed": 1200}


def test_who_is_far_behind_gives_way_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus, recording = MemoryBus(), DriveRecording(tmp_path / "drive.mcap")
    process = recorder(bus, recording, lossless=False)
    wrote, add = [], recording.add

    def written(*message: Any, **numbered: Any) -> Any:
        wrote.append(
            (threading.get_ident(), os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
        )
        if len(wrote) == 1700:
            bus.publish("run_end", RunEnd(stamp_ns=START_NS), run="r1")
        return add(*message, **numbered)

    monkeypatch.setattr(recording, "add", written)
    for number in range(1700):
        bus.publish("speed", SpeedSample(stamp_ns=START_NS + number, speed_mps=1.0), vehicle="car")
    process.run()

    hurries = threading.get_ident()
    assert [one == hurries for one, _ in wrote] == [True] * 1002 + [False] * 698
    assert wrote[-1][1] >= max(wrote[0][1], 10)
    assert recording.tally.recorded == {"speed": 1700}
