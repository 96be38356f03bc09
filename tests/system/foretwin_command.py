"""Runs the command as a user does: a process of its own, its files looked at afterwards."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow.parquet as pq

from foretwin.orchestrator.record.table_stream import StreamReader
from tests.contracts.bus_sides import DEADLINE_S
from tests.log_lines import read_log
from tests.system.warm_command import WarmCommand

REPOSITORY = Path(__file__).parents[2]
_BEGAN_NS = time.monotonic_ns()
FRESH = ("-m", "foretwin")
"""What a fresh interpreter is given to run, as when a user starts the command."""


class Finished(NamedTuple):
    """What a command left: exit code, screen, and the folder of its run, if it made one."""

    code: int
    screen: str
    run: Path | None

    def record(self) -> dict[str, Any]:
        assert self.run is not None
        return json.loads((self.run / "run.json").read_text(encoding="utf-8"))

    def rows(self, table: str) -> list[dict[str, Any]]:
        assert self.run is not None
        return pq.read_table(self.run / "results" / f"{table}.parquet").to_pylist()


def environment(cache: Path, *, pace: float = 1.0) -> dict[str, str]:
    """Return what processes are started with; by their clocks they live at `pace` (slow_motion).

    A machine that has half of what a drive needs has all of it at half the pace, by its own time.
    """
    mine = os.environ | {"XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(REPOSITORY)}
    if pace == 1.0:
        return mine
    path = f"{REPOSITORY / 'tests' / 'system' / 'slow_motion'}{os.pathsep}{REPOSITORY}"
    return mine | {"PYTHONPATH": path, "SLOW_MOTION": f"{pace}@{_BEGAN_NS}"}


def foretwin(out: Path, *arguments: str, timeout_s: float = 280.0) -> Finished:
    """Run `foretwin drive` to its end."""
    with started(out, *arguments) as process:
        screen, _ = process.communicate(timeout=timeout_s)
    return Finished(process.returncode, screen, run_folder(out))


def slow_s(pace: float) -> float:
    """Return the monotonic clock of processes that live at `pace`."""
    began_s = _BEGAN_NS / 1e9
    return began_s + (time.monotonic() - began_s) * pace


@contextmanager
def started(
    out: Path,
    *arguments: str,
    entry: tuple[str, str] | None = None,
    pace: float = 1.0,
    changed_by: str = "",
) -> Iterator[subprocess.Popen[str] | WarmCommand]:
    """Start `foretwin drive`; whatever happens, it and its processes are gone afterwards.

    `entry` is what a fresh interpreter is given to run; None for a fork of one that has imported
    all, which knows no `pace` but 1 and first runs the program `changed_by`. One worker and no
    tuning unless they are asked for.
    """
    for option, value in (("--tuning", "off"), ("--workers", "1")):
        if option not in arguments:
            arguments = (*arguments, option, value)
    words = ["drive", "--view", "none", "--out", str(out), *arguments]
    cwd, env = out.parent, environment(out.parent / "cache", pace=pace)
    process: subprocess.Popen[str] | WarmCommand
    if entry is None:
        process = WarmCommand(words, cwd=cwd, env=env, changed_by=changed_by)
    else:
        process = subprocess.Popen(
            [sys.executable, "-P", *entry, *words], cwd=cwd, env=env, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(DEADLINE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        if process.stdout is not None:
            process.stdout.close()
        folder = run_folder(out)
        for pid in child_pids(folder).values() if folder else ():
            if is_running(pid):
                os.kill(pid, signal.SIGKILL)


def end_process(process: subprocess.Popen[Any], *, within_s: float = 60.0) -> None:
    """End a process, by force where it takes longer; what it still says is read away."""
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
        try:
            process.communicate(timeout=within_s)
        except subprocess.TimeoutExpired:
            process.kill()
    process.communicate()


def run_folder(out: Path) -> Path | None:
    """Return the folder of the only run below `out`, None where there is none."""
    try:
        runs = sorted(path for path in out.iterdir() if path.is_dir())
    except FileNotFoundError:  # nor while the drive tries whether it may be written there
        return None
    assert len(runs) <= 1
    return runs[0] if runs else None


def log_lines(run: Path) -> list[dict[str, Any]]:
    """Return the lines of the run's log that are there so far."""
    file = run / "log.jsonl"
    return read_log(file).lines if file.exists() else []


def rows_so_far(run: Path, table: str) -> int:
    """Return how many rows a table of a drive that goes on has; its file is there before them."""
    stream = run / "results" / f"{table}.arrows"
    return sum(part.num_rows for part in StreamReader(stream).records()) if stream.exists() else 0


def child_pids(run: Path) -> dict[str, int]:
    """Return the newest process of each id that the log names."""
    pids = {}
    for line in log_lines(run):
        text = line["text"]
        if line.get("source") == "orchestrator" and text.startswith("started "):
            pids[text.split()[1]] = int(text.rsplit(" ", 1)[1])
    return pids


def orchestrator_pid(run: Path) -> int:
    """Return the process of the newest orchestrator that the log names."""
    forked = [one["text"] for one in log_lines(run) if one["text"].startswith("forked the orch")]
    return int(forked[-1].rsplit(" ", 1)[1])


def wait_for(condition: Callable[[], bool], what: str, *, within_s: float = DEADLINE_S) -> float:
    """Wait until a condition holds; returns the seconds that took, fails after `within_s`."""
    begun = time.monotonic()
    pause = Pause()
    while not condition():
        assert time.monotonic() - begun < within_s, f"waited {within_s} s for {what}"
        pause()
    return time.monotonic() - begun


class Pause:
    """Lets others run between two looks at a condition."""

    def __call__(self) -> None:
        signal.sigtimedwait([], 0.02)


def is_running(pid: int) -> bool:
    """Whether a process exists and is no zombie."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
