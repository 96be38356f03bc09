"""Whatever refuses, dies or freezes: jobs go to who does them, and the run's ledger balances."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.keys import alive_key
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.setup import BusSetup
from foretwin.orchestrator.record.ledger import Ledger
from tests.system.foretwin_command import child_pids, foretwin, orchestrator_pid, started, wait_for
from tests.system.test_faults import LIVE, assert_nothing_left, says, under_way

ENDS_WITHIN_S = 240.0
TWO = ("--workers", "2")
LOCK_STEP = ("--speed", "max", "--futures", "16", "--rate", "1", "--end", "12", *TWO)

pytestmark = pytest.mark.timeout(600)


def record_of(run: Path) -> dict[str, Any]:
    return json.loads((run / "run.json").read_text(encoding="utf-8"))


def ledger_of(run: Path) -> Ledger:
    """The ledger of a run, which balances."""
    ledger = msgspec.convert(record_of(run)["ledger"], Ledger)
    assert ledger.balanced(), ledger
    return ledger


def loaded_by(run: Path, worker_id: str) -> set[str]:
    text = (run / "log.jsonl").read_text(encoding="utf-8")
    return set(re.findall(rf"world (\w+) loaded by {worker_id}", text))


@contextmanager
def hidden(run: Path, world_ids: set[str]) -> Iterator[None]:
    """Take the files of Worlds away: a worker that starts now cannot play in them."""
    files = [run / "worlds" / f"{world_id}.world" for world_id in world_ids]
    for file in files:
        file.rename(file.with_suffix(".hidden"))
    yield
    for file in files:
        file.with_suffix(".hidden").rename(file)


@contextmanager
def frozen(pid: int) -> Iterator[None]:
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


@pytest.mark.judge
def test_a_sick_worker_takes_no_round_down_and_is_tried_again(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, *TWO) as process:
        run = under_way(out)
        wait_for(lambda: bool(loaded_by(run, "w1")), "the other worker's World")
        with hidden(run, loaded_by(run, "w1")):
            os.kill(child_pids(run)["w0"], signal.SIGKILL)
            wait_for(lambda: says(run, "w0 is sick, it refuses jobs: "), "the sick worker")
        wait_for(lambda: says(run, "w0 is given jobs again"), "its getting well")
        process.send_signal(signal.SIGINT)
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 130, screen
    record, ledger = record_of(run), ledger_of(run)
    assert record["dropped"]["given_up_rounds"] == 0
    assert record["workers"]["refusals"].keys() == {"w0"}
    assert "No such file" in record["workers"]["refusals"]["w0"]["last"]
    assert not record["workers"]["refusals"]["w0"]["sick"]
    assert ledger.rounds.run > 0
    assert ledger.jobs.refused == 0
    assert "lost: " not in screen
    assert_nothing_left(run)


@pytest.mark.judge
def test_a_run_whose_workers_all_refuse_goes_on_and_says_so_last(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    with started(out, *LIVE, *TWO, "--end", "25") as process:
        run = under_way(out)
        wait_for(lambda: bool(loaded_by(run, "w1")), "the other worker's World")
        with hidden(run, loaded_by(run, "w1")):
            for worker_id in ("w0", "w1"):
                os.kill(child_pids(run)[worker_id], signal.SIGKILL)
            wait_for(lambda: says(run, " is given up: "), "a round that nobody runs")
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 3, screen
    ledger = ledger_of(run)
    assert ledger.rounds.given_up >= 1
    assert ledger.jobs.refused >= 1
    assert screen.splitlines()[-1].startswith("lost: ")
    assert_nothing_left(run)


def test_the_ledger_balances_after_freezes_kills_and_strangers(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    endpoint = free_endpoint()
    with started(out, *LIVE, *TWO, "--endpoint", endpoint, "--insecure") as process:
        run = under_way(out)
        with ZenohBus(BusSetup(endpoint=endpoint)) as stranger:
            for name in ("w7", "w8"):
                stranger.declare_alive(alive_key(run=run.name, process=name))
            wait_for(lambda: says(run, "'w7' says") or says(run, "'w8' says"), "the warning")
            os.kill(child_pids(run)["w0"], signal.SIGSTOP)
            wait_for(lambda: says(run, "w0 ended with code -9; started again"), "its end")
            thawed_s = time.monotonic() + 3.0
            with frozen(orchestrator_pid(run)):
                wait_for(lambda: time.monotonic() > thawed_s, "three seconds")
            os.kill(child_pids(run)["w1"], signal.SIGKILL)
            wait_for(lambda: says(run, "w1 ended with code -9; started again"), "the death")
        process.send_signal(signal.SIGINT)
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 130, screen
    record, ledger = record_of(run), ledger_of(run)
    assert record["workers"]["strangers"] >= 2  # again after the freeze
    # Those that fell due in the three seconds, but for the one at their end.
    assert ledger.rounds.missed >= 5
    assert ledger.rounds.due >= ledger.rounds.run + 5
    assert ledger.jobs.given >= ledger.rounds.run
    assert_nothing_left(run)


@pytest.mark.judge  # a killed orchestrator in lock step is in the fast suite
def test_in_lock_step_a_sick_worker_changes_no_bit(tmp_path: Path) -> None:
    whole = foretwin(tmp_path / "whole", *LOCK_STEP)
    out = tmp_path / "torn"
    with started(out, *LOCK_STEP) as process:
        run = under_way(out)
        wait_for(lambda: bool(loaded_by(run, "w1")), "the other worker's World")
        with hidden(run, loaded_by(run, "w1")):
            with frozen(child_pids(run)["vehicle"]):  # the drive waits for it
                os.kill(child_pids(run)["w0"], signal.SIGKILL)
                wait_for(lambda: says(run, "w0 could not load world"), "its start without a World")
            wait_for(lambda: says(run, "w0 is sick, it refuses jobs: "), "the sick worker")
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert (whole.code, process.returncode) == (0, 0), screen
    one, other = whole.record(), record_of(run)
    assert one["futures"]["sha256"] == other["futures"]["sha256"]
    assert one["ledger"] == other["ledger"]
    ledger = ledger_of(run)
    assert ledger.rounds.run == one["futures"]["rounds"] > 5
    assert (ledger.rounds.missed, ledger.rounds.given_up) == (0, 0)
    assert ledger.jobs.results == ledger.jobs.given


@pytest.mark.judge
def test_in_lock_step_nothing_waits_for_a_worker_that_is_started_no_more(tmp_path: Path) -> None:
    out = tmp_path / "runs"
    gone = "w1 ended with code -9; the drive goes on without it"
    with started(out, *LOCK_STEP) as process:
        run = under_way(out)
        wait_for(lambda: bool(loaded_by(run, "w0")), "a World")
        with hidden(run, loaded_by(run, "w0")):
            with frozen(child_pids(run)["vehicle"]):  # the drive waits for it
                killed: set[int] = set()
                while not says(run, gone):
                    wait_for(lambda: says(run, gone) or child_pids(run)["w1"] not in killed, "w1")
                    if (pid := child_pids(run)["w1"]) not in killed:
                        killed.add(pid)
                        os.kill(pid, signal.SIGKILL)
                os.kill(child_pids(run)["w0"], signal.SIGKILL)
                wait_for(lambda: says(run, "w0 could not load world"), "its start without a World")
            wait_for(lambda: says(run, " is given up: "), "a round that nobody runs")
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 3, screen
    ledger = ledger_of(run)
    assert (ledger.rounds.missed, ledger.rounds.given_up > 0) == (0, True)
    assert ledger.rounds.run > 0
