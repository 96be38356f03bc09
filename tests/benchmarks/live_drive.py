"""Live drives with viewer and recorder: what their rounds and their processes took.

Tracing takes processor time of its own, that of the orchestrator most: a quarter of its share.
"""

from __future__ import annotations

import functools
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow.parquet as pq

from tests.benchmarks.measuring import UnavailableError

END_S, SETTLED_S = 45, 10.0
"""Seconds of the drive, and those of its beginning that do not count."""
_LOOK_S = 0.25
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class CpuLook(NamedTuple):
    """What the processes of a drive had taken at an instant, and the whole machine."""

    mono_s: float
    lives: dict[str, tuple[float, float]]
    """By process: seconds since it could take work, and processor seconds."""
    machine_s: float


class LiveDrive(NamedTuple):
    """What a drive's rounds took after its beginning, in milliseconds, and its processes, as shares
    of a core, from then on to the vehicle's last word."""

    rounds: int
    wall_ms: float
    jobs_cpu_ms: float
    """Processor time of a round's jobs together."""
    slowest_job_cpu_ms: float
    """Of the dearest job of each: what a round takes where every worker has a core to itself. Of a
    traced drive alone, else not a number."""
    orchestrator_cpu_ms: float
    """What the orchestrator takes to start a round and to take it apart; the same."""
    p95_ms: float
    late: int
    missed: int
    """At most so many: of the whole drive, or what is not there of the settled one, spared ones
    and those for which the vehicle said nothing included."""
    least_futures: int
    shares: dict[str, float]
    others_cores: float
    """What everybody else took of the machine meanwhile."""


@functools.cache
def live_drive() -> LiveDrive:
    """Drive through the drawn town once for all benchmarks that ask."""
    with tempfile.TemporaryDirectory() as name:
        return drive_live(["--trace"], Path(name))


def drive_live(options: Sequence[str], out: Path, *, end_s: float = END_S) -> LiveDrive:
    """Drive into an empty folder and measure it. Raises UnavailableError where that fails."""
    command = [sys.executable, "-m", "foretwin", "drive", "--view", "none", *options]
    looks: list[CpuLook] = []
    with (out / "said.txt").open("w+", encoding="utf-8") as said:
        process = subprocess.Popen(
            [*command, "--end", f"{end_s:g}", "--out", str(out / "runs")],
            env=os.environ | {"XDG_CACHE_HOME": str(out / "cache")},
            stdout=said,
            stderr=said,
        )
        try:
            while process.poll() is None:
                looks.append(_look(out / "runs"))
                time.sleep(_LOOK_S)
        finally:
            process.kill()
            process.wait()
        if process.returncode:
            said.seek(0)
            raise UnavailableError(f"a drive ends with {process.returncode}: {said.read()[-2000:]}")
    (run,) = (out / "runs").iterdir()
    return read_live_drive(run, looks, end_s=end_s)


def _look(runs: Path) -> CpuLook:
    lives = {}
    for file in runs.glob("*/processes/*.cpu"):
        try:
            life = json.loads(file.read_bytes())
        except (OSError, json.JSONDecodeError):
            continue  # it is being written
        lives[file.stem.rsplit("-", 1)[0]] = life["ready_s"], life["cpu_s"]
    ticks = [int(n) for n in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    return CpuLook(time.monotonic(), lives, (sum(ticks) - ticks[3] - ticks[4]) / _TICKS_PER_S)


def read_live_drive(run: Path, looks: Sequence[CpuLook], *, end_s: float = END_S) -> LiveDrive:
    """Return what the folder of a drive tells, and what was looked at meanwhile."""
    record = json.loads((run / "run.json").read_bytes())
    trace = run / "trace.json"
    events = json.loads(trace.read_bytes())["traceEvents"] if trace.exists() else []
    rows = pq.read_table(run / "results" / "rounds.parquet").to_pylist()
    settled = {row["round_id"]: row for row in rows if row["drive_time_s"] >= SETTLED_S}
    jobs = _jobs_of_rounds(events)
    slowest_ms = [max(jobs[number]) for number in settled if number in jobs]
    wall_ms = sorted(row["latency_ms"] for row in settled.values())
    shares, others_cores = shares_between(looks, SETTLED_S, end_s)
    return LiveDrive(
        rounds=len(settled),
        wall_ms=statistics.median(wall_ms),
        jobs_cpu_ms=statistics.median(1e3 * row["cpu_seconds"] for row in settled.values()),
        slowest_job_cpu_ms=statistics.median(slowest_ms) if events else math.nan,
        orchestrator_cpu_ms=_own_ms(events) if events else math.nan,
        p95_ms=statistics.quantiles(wall_ms, n=20)[-1],
        late=sum(row["late"] for row in settled.values()),
        missed=min(record["ledger"]["rounds"]["missed"], _gaps(list(settled.values()))),
        least_futures=min(row["futures"] for row in settled.values()),
        shares=shares,
        others_cores=others_cores,
    )


def shares_between(
    looks: Sequence[CpuLook], from_s: float, to_s: float
) -> tuple[dict[str, float], float]:
    """Return what each process took of a core between two ages of the orchestrator, and how many
    cores everybody else took.

    What is said of a process is up to two seconds old, and each counts for the time that it
    speaks of.
    """
    aged = [look for look in looks if from_s <= look.lives.get("orchestrator", (0.0, 0.0))[0]]
    within = [look for look in aged if look.lives["orchestrator"][0] <= to_s]
    if not within or within[0].lives["orchestrator"] == within[-1].lives["orchestrator"]:
        raise UnavailableError(f"no processor time is known from {from_s:g} s to {to_s:g} s")
    first, last = within[0].lives, within[-1].lives
    shares = {
        name: (last[name][1] - first[name][1]) / (last[name][0] - first[name][0])
        for name in last
        if name in first and last[name][0] > first[name][0]
    }
    passed_s = within[-1].mono_s - within[0].mono_s
    machine = (within[-1].machine_s - within[0].machine_s) / passed_s
    return shares, max(machine - sum(shares.values()), 0.0)


def _gaps(rows: Sequence[dict[str, Any]], *, rate_hz: float = 2.0) -> int:
    """Return how many rounds are not there between those that are."""
    at_s = sorted(row["drive_time_s"] for row in rows)
    return sum(max(0, round(rate_hz * (after - before)) - 1) for before, after in pairwise(at_s))


def _jobs_of_rounds(events: list[dict[str, Any]]) -> dict[int, list[float]]:
    """Return the processor milliseconds of each round's jobs, in the order of the trace."""
    workers = {
        event["pid"]
        for event in events
        if event["name"] == "process_name" and event["args"]["name"].startswith("w")
    }
    rounds = [e for e in events if e["ph"] == "b" and e["name"] == "round"]
    ends_us = {e["id2"]["local"]: e["ts"] for e in events if e["ph"] == "e"}
    jobs = [e for e in events if e["ph"] == "X" and e["name"] == "job" and e["pid"] in workers]
    return {
        one["args"]["id"]: found
        for one in rounds
        if (
            found := [
                job["tdur"] / 1e3
                for job in jobs
                if one["ts"] <= job["ts"] <= ends_us[one["id2"]["local"]]
            ]
        )
    }


def _own_ms(events: list[dict[str, Any]]) -> float:
    """Return the processor milliseconds that the orchestrator takes for a round, at its median."""
    return sum(
        statistics.median(e["tdur"] / 1e3 for e in events if e["ph"] == "X" and e["name"] == name)
        for name in ("start a round", "take a round apart")
    )
