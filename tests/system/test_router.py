"""The router dies or stands still, or the orchestrator does: a live drive goes on, whole."""

from __future__ import annotations

import json
import os
import signal
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from tests.starvation import kept_waiting
from tests.system.foretwin_command import (
    Pause,
    child_pids,
    log_lines,
    run_folder,
    started,
    wait_for,
)
from tests.system.test_faults import ENDS_WITHIN_S, LIVE, assert_nothing_left, says, under_way

FROZEN_S = 8.0


def starts(run: Path) -> Counter[str]:
    """Return how often each process was started."""
    said = (line["text"] for line in log_lines(run) if line.get("source") == "orchestrator")
    return Counter(text.split()[1] for text in said if text.startswith("started "))


def heard_from_s(run: Path, since_s: float) -> list[float]:
    """Return when workers said, after a moment, that they had loaded a World."""
    lines = [line for line in log_lines(run) if "loaded by w" in line["text"]]
    return [line["wall_s"] for line in lines if line["wall_s"] >= since_s]


def assert_balanced(run: Path) -> None:
    """The drive is complete, every ledger balances and no sample is lost."""
    record: dict[str, Any] = json.loads((run / "run.json").read_text(encoding="utf-8"))
    assert record["exit"] == "completed"
    assert record["troubles"] == []
    assert record["processor"]["router"]["cpu_s"] > 0.0
    telemetry, rounds, jobs = (record["ledger"][name] for name in ("telemetry", "rounds", "jobs"))
    assert telemetry["published"] == telemetry["recorded"] > 0
    assert telemetry["lost"] == 0
    assert rounds["due"] == sum(count for name, count in rounds.items() if name != "due")
    assert jobs["given"] == jobs["results"] + jobs["refused"] + jobs["lost"]
    assert jobs["results"] > 0


@pytest.mark.judge
def test_a_killed_router_is_there_again_within_a_second_and_nobody_else_is_started_again(
    tmp_path: Path,
) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "12") as process:
        run = under_way(out)
        before = starts(run)
        with kept_waiting(process.pid) as kept:
            killed_s = time.time()
            os.kill(child_pids(run)["router"], signal.SIGKILL)
            wait_for(lambda: says(run, "router ended with code -9; started again"), "the death")
            wait_for(lambda: bool(heard_from_s(run, killed_s + 0.05)), "the workers being back")
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 0, screen
    assert heard_from_s(run, killed_s + 0.05)[0] - killed_s - kept.seconds < 1.0
    assert starts(run) - before == Counter(["router"])
    assert_balanced(run)
    assert_nothing_left(run)


@pytest.mark.judge  # one that is killed is replaced in the fast suite
def test_a_router_that_stands_still_is_replaced(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "16") as process:
        run = under_way(out)
        before = starts(run)
        os.kill(child_pids(run)["router"], signal.SIGSTOP)
        wait_for(lambda: says(run, "router hangs: killed"), "the router being killed")
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 0, screen
    assert starts(run) - before == Counter(["router"])
    assert_balanced(run)
    assert_nothing_left(run)


@pytest.mark.judge  # chaos stops it too
def test_an_orchestrator_that_stands_still_for_a_while_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, "--end", "14") as process:
        run = under_way(out)
        before = starts(run)
        process.send_signal(signal.SIGSTOP)
        pause, until_s = Pause(), time.monotonic() + FROZEN_S
        while time.monotonic() < until_s:
            pause()
        process.send_signal(signal.SIGCONT)
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 0, screen
    assert starts(run) == before, "nobody is started again for it"
    assert_balanced(run)
    assert_nothing_left(run)


def test_in_lock_step_the_end_of_the_router_ends_the_drive_with_one_line(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, "--speed", "max", "--futures", "4") as process:
        wait_for(lambda: run_folder(out) is not None, "the run's folder")
        run = run_folder(out)
        assert run is not None
        wait_for(lambda: says(run, "loaded by"), "the first world")
        os.kill(child_pids(run)["router"], signal.SIGKILL)
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 1, screen
    (line,) = [line for line in screen.splitlines() if line.startswith("foretwin: ")]
    assert "the router died, and with it what was on its way" in line
    assert json.loads((run / "run.json").read_text(encoding="utf-8"))["exit"] == "failed"
    assert_nothing_left(run)
