"""What operators are told of a drive while it goes on, also by an orchestrator started again."""

from __future__ import annotations

import os
import re
import signal
from functools import partial
from pathlib import Path

import httpx

from foretwin.contracts.ports import LOOPBACK, free_port
from tests.system.foretwin_command import orchestrator_pid, run_folder, started, wait_for


def page(port: int) -> dict[str, float]:
    """What is told now; nothing while nobody answers."""
    try:
        text = httpx.get(f"http://{LOOPBACK}:{port}/metrics", timeout=1.0).raise_for_status().text
    except httpx.HTTPError:
        return {}
    rows = re.findall(r"^foretwin_(\S+) (\S+)$", text, re.MULTILINE)
    return {name: float(value) for name, value in rows}


def rounds_run(port: int) -> float:
    return page(port).get('rounds_ended_total{how="run"}', 0.0)


def test_a_drive_tells_how_it_goes_before_and_after_its_orchestrator_died(tmp_path: Path) -> None:
    port = free_port()
    with started(tmp_path / "runs", "--futures", "12", "--metrics", str(port)) as process:
        wait_for(lambda: rounds_run(port) >= 2, "two rounds to be told")
        run = run_folder(tmp_path / "runs")
        assert run is not None
        before = page(port)
        died = orchestrator_pid(run)
        os.kill(died, signal.SIGKILL)
        wait_for(lambda: rounds_run(port) > before['rounds_ended_total{how="run"}'], "a round more")
        after = page(port)
        assert orchestrator_pid(run) != died
        process.send_signal(signal.SIGINT)
        wait_for(partial(process_ended, process), "the end")

    assert before['worker_speed_ratio{worker="w0"}'] > 0.0
    assert 0.0 <= after["telemetry_age_seconds"] < 5.0
    assert after['rounds_ended_total{how="missed"}'] >= before['rounds_ended_total{how="missed"}']
    assert page(port) == {}


def process_ended(process: object) -> bool:
    return process.poll() is not None  # type: ignore[attr-defined]
