"""Processes that live more slowly than the world does."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from foretwin.contracts.zenoh_config import LEASE_MS
from tests.system.foretwin_command import environment, slow_s

CLOCKS = """
import json, time, threading
clocks = "time", "monotonic", "perf_counter"
def told():
    once = {name: [getattr(time, name)(), getattr(time, name + "_ns")() / 1e9] for name in clocks}
    return once | {"world": time.clock_gettime(time.CLOCK_MONOTONIC)}
from foretwin.contracts.zenoh_config import LEASE_MS
first = told()
time.sleep(0.05)
threading.Event().wait(0.1)
print(json.dumps([first, told(), LEASE_MS]))
"""


@pytest.mark.parametrize("pace", [0.25, 1.0])
def test_all_clocks_of_such_a_process_go_at_its_pace(tmp_path: Path, pace: float) -> None:
    before_s = slow_s(pace)
    command = [sys.executable, "-P", "-c", CLOCKS]
    done = subprocess.run(
        command, env=environment(tmp_path, pace=pace), capture_output=True, text=True, check=True
    )
    after_s = slow_s(pace)
    first, second, lease_ms = json.loads(done.stdout)
    assert lease_ms == LEASE_MS / pace
    took_s = second["world"] - first["world"]
    assert took_s >= 0.05 / pace + 0.1
    for name in ("time", "monotonic", "perf_counter"):
        for k in (0, 1):
            assert second[name][k] - first[name][k] == pytest.approx(pace * took_s, abs=0.02)
        assert first[name][0] == pytest.approx(first[name][1], abs=0.02)
    assert before_s <= first["monotonic"][0] <= second["monotonic"][0] <= after_s
    assert time.time() - 3600.0 < first["time"][0] <= time.time()
