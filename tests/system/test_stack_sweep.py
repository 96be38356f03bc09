"""A driving stack serves sweeps: the same rows with any number of workers, whatever befalls it."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foretwin.orchestrator.commands.cli import run
from tests.orchestrator.sweeps import small_sweep
from tests.sim_worker.planners.a_stack import spec_of
from tests.system.foretwin_command import REPOSITORY, wait_for

MODULE = "tests.sim_worker.planners.a_stack"
LOOPS = 30
"""Busy processes beside the sweep."""


def commands_running(word: str) -> list[str]:
    """Command lines of processes that hold a word."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                found.append((entry / "cmdline").read_bytes().replace(b"\0", b" ").decode())
            except OSError:
                continue
    return [line for line in found if word in line]


class Sweeps:
    """Sweeps of one stack in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def swept(self, how: str, *, name: str, workers: int = 1, table: str = "") -> dict[str, Any]:
        """Play a small sweep and return its summary; `how` are words for `a_stack`."""
        command = f"{shlex.quote(sys.executable)} -m {MODULE} {how}"
        spec = small_sweep(self.folder, spec_of(command, table))
        code = run(["sweep", str(spec), "--out", str(self.out(name)), "--workers", str(workers)])
        summary = json.loads((self.out(name) / "sweep.json").read_bytes())
        assert code == (3 if summary["failed"] else 0)
        return summary

    def out(self, name: str) -> Path:
        return self.folder / name

    def rows(self, name: str) -> list[dict[str, Any]]:
        return pq.read_table(self.out(name) / "rows").sort_by("cell").to_pylist()


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The summary of a sweep in which nothing befalls the stack."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(REPOSITORY))
        return Sweeps(tmp_path_factory.mktemp("plain")).swept("straight", name="plain")


@pytest.fixture
def sweeps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Sweeps:
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    return Sweeps(tmp_path)


@pytest.mark.judge
def test_one_that_remembers_gives_the_same_rows_with_one_and_two_workers(sweeps: Sweeps) -> None:
    table = "stateful = true\ninstances = 2\nlatency_s = 0.1"
    one = sweeps.swept("remembers", name="one", table=table)
    two = sweeps.swept("remembers", name="two", workers=2, table=table)
    assert one["failed"] == 0
    assert one["placed"] > 2
    assert one["rows_sha256"] == two["rows_sha256"]
    assert one["planners"]["mine"]["name"] == "remembers"
    assert len({row["progress_m"] for row in sweeps.rows("one") if row["valid"]}) > 1
    wait_for(lambda: not commands_running(f"{MODULE} remembers"), "the end of the stacks")


@pytest.mark.judge
def test_who_dies_is_started_again_and_the_rows_are_the_same(
    sweeps: Sweeps, plain: dict[str, Any]
) -> None:
    mark = sweeps.folder / "mark"
    died = sweeps.swept(f"dies {mark}", name="died")
    assert mark.exists()
    assert died["failed"] == 0
    assert died["rows_sha256"] == plain["rows_sha256"]
    log = (sweeps.out("died") / "log.jsonl").read_text()
    assert "is played again: planner 'mine': its process ended by exit code 3" in log
    assert "the sky is falling" in (sweeps.out("died") / "stacks" / "w0-mine-0.log").read_text()


def test_who_hangs_leaves_failed_rows_which_the_next_start_plays(
    sweeps: Sweeps, plain: dict[str, Any]
) -> None:
    mark = sweeps.folder / "mark"
    hung = sweeps.swept(f"hangs {mark}", name="out", table="answer_within_s = 2")
    failed = [row for row in sweeps.rows("out") if row["failure"]]
    assert hung["complete"]
    assert hung["failed"] == len(failed) > 0
    words = "planner 'mine' at 0.4 s: gave no answer within 2 s of wall time and was ended"
    assert {row["failure"] for row in failed} == {words}
    again = sweeps.swept(f"hangs {mark}", name="out", table="answer_within_s = 120")
    assert (again["failed"], again["jobs_played"]) == (0, 1)
    assert again["rows_sha256"] == plain["rows_sha256"]


def test_a_sweep_that_is_killed_leaves_no_stack(sweeps: Sweeps) -> None:
    command = f"{shlex.quote(sys.executable)} -m {MODULE} hangs"
    spec = small_sweep(sweeps.folder, spec_of(command))
    words = [sys.executable, "-m", "foretwin", "sweep", str(spec), "--out", str(sweeps.out("out"))]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    log = sweeps.out("out") / "stacks" / "w0-mine-0.log"
    try:
        wait_for(log.exists, "the stack's own log, after it has introduced itself")
        wait_for(lambda: bool(commands_running(command)), "the start of the stack")
    finally:
        process.kill()
        process.wait()
    wait_for(lambda: not commands_running(command), "the end of the stack", within_s=15.0)


@pytest.mark.judge
def test_under_load_a_slow_stack_comes_to_the_same_rows(sweeps: Sweeps) -> None:
    """48 ms of computing for each answer, among `LOOPS` processes that never wait."""
    patient = "answer_within_s = 600\nstart_within_s = 600"
    quiet = sweeps.swept("slow", name="quiet", table=patient)
    with busy(LOOPS):
        loaded = sweeps.swept("slow", name="loaded", table=patient)
    print(f"quiet {quiet['playing_s']} s, among {LOOPS} loops {loaded['playing_s']} s")
    assert loaded["failed"] == 0
    assert loaded["rows_sha256"] == quiet["rows_sha256"]


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Keep the machine busy with so many processes."""
    words = [sys.executable, "-c", "while True: pass"]
    # Each in a session of its own: Linux shares processors out among these first (autogroup).
    loops = [subprocess.Popen(words, start_new_session=True) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()
