"""The live stream never holds up its writer, whatever the window does."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from foretwin.contracts.ports import free_port
from foretwin.viewer import sinks
from foretwin.viewer.blueprint import drive_blueprint
from foretwin.viewer.live_viewer import address, start_program, wait_until_it_answers
from foretwin.viewer.rows import Row
from foretwin.viewer.sinks import LIVE_ROWS, FileStream, LiveStream
from tests.contracts.bus_sides import DEADLINE_S
from tests.starvation import KeptWaiting, kept_waiting
from tests.viewer.conftest import wait_until
from tests.viewer.readback import Recorded

HEAVY = rr.Points3D(np.zeros((150_000, 3), dtype=np.float32))
"""1.8 MB: a frozen window takes about 200 MB before `log` blocks."""


def test_a_frozen_window_costs_rows_and_no_time(tmp_path: Path) -> None:
    port = free_port()
    window = start_program("--serve-grpc", "--server-memory-limit", "64MB", port=port)
    try:
        wait_until_it_answers(window, port)
        live = LiveStream(lambda: address(port), recording_id="frozen", blueprint=drive_blueprint())
        live.write([Row("world/futures", 0, HEAVY)])
        os.kill(window.pid, signal.SIGSTOP)
        written, slowest_s, deadline_s = 1, 0.0, time.monotonic() + DEADLINE_S
        while live.dropped < 20:
            assert time.monotonic() < deadline_s, f"{written} rows went into a frozen window"
            before_s, kept = time.monotonic(), KeptWaiting([os.getpid()])
            live.write([Row("world/futures", written, HEAVY)])
            taken_s = time.monotonic() - before_s
            kept.look()
            slowest_s = max(slowest_s, taken_s - kept.seconds)
            written += 1
            if live.waiting > LIVE_ROWS // 2:
                time.sleep(0.001)  # let the live thread run into the wall
        assert slowest_s < 0.5
        before_s = time.monotonic()
        with kept_waiting() as closing:
            assert not live.close(0.5)
        assert time.monotonic() - before_s - closing.seconds < 2.0
    finally:
        os.kill(window.pid, signal.SIGCONT)
        window.kill()
        window.wait()


def test_an_absent_window_is_told_and_the_file_goes_on(tmp_path: Path) -> None:
    def no_window() -> str:
        raise OSError("no display")

    live = LiveStream(no_window, recording_id="absent", blueprint=drive_blueprint())
    wait_until(lambda: live.failed is not None)
    assert live.failed == "no display"
    file = FileStream(
        tmp_path / "a.rrd", recording_id="absent", title="東京", blueprint=drive_blueprint()
    )
    rows = [Row("gap/pos_m/twin", n * 100_000_000, rr.Scalars(float(n))) for n in range(1000)]
    live.write(rows)
    file.write(rows)
    file.close()
    assert live.close(DEADLINE_S)
    assert len(Recorded(tmp_path / "a.rrd").times_s("/gap/pos_m/twin")) == 1000
    assert live.dropped == 1000 - LIVE_ROWS


class StuckStream:
    """As Rerun's after the disk was full: flushes fail, and ending it may take for ever."""

    def __init__(self) -> None:
        self.well = False

    def flush(self, *, timeout_sec: float) -> None:
        if not self.well:
            raise RuntimeError("File-writer thread shut down prematurely")

    def disconnect(self) -> None:
        threading.Event().wait()


def test_a_file_that_takes_nothing_any_more_is_told_of_and_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sinks, "FLUSH_S", 0.1)
    kept: list[object] = []
    monkeypatch.setattr(sinks, "_NEVER_DROPPED", kept)
    file = FileStream(tmp_path / "a.rrd", recording_id="r", title="t", blueprint=drive_blueprint())
    stuck = StuckStream()
    file._stream, whole = stuck, file._stream  # type: ignore[assignment]
    whole.disconnect()
    for well in (False, False, True, False, False):  # a machine that is busy now and then
        stuck.well = well
        file.flush()
    with pytest.raises(OSError, match="takes nothing any more"):
        file.flush()
    assert kept == [stuck]
    kept.clear()
    monkeypatch.setattr(file, "flush", lambda: None)
    file.close()
    assert kept == [stuck], "ending it may hang as well"
