"""One live drive through the drawn town with viewer and recorder, traced: what its rounds took."""

from __future__ import annotations

import functools
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow.parquet as pq

from tests.benchmarks.measuring import UnavailableError

END_S, SETTLED_S = 30, 10.0
"""Seconds of the drive, and those of its beginning that do not count."""


class LiveDrive(NamedTuple):
    """What a drive's rounds took after its beginning, in milliseconds, and its processes, as shares
    of a core since each could take work."""

    rounds: int
    wall_ms: float
    jobs_cpu_ms: float
    """Processor time of a round's jobs together."""
    slowest_job_cpu_ms: float
    """Of the dearest job of each: what a round takes where every worker has a core to itself."""
    orchestrator_cpu_ms: float
    """What the orchestrator takes to start a round and to take it apart."""
    p95_ms: float
    late: int
    missed: int
    least_futures: int
    shares: dict[str, float]


@functools.cache
def live_drive() -> LiveDrive:
    """Drive once for all benchmarks that ask."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name)
        command = [sys.executable, "-m", "foretwin", "drive", "--view", "none", "--trace"]
        done = subprocess.run(
            [*command, "--end", str(END_S), "--out", str(out / "runs")],
            env=os.environ | {"XDG_CACHE_HOME": str(out / "cache")},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise UnavailableError(f"a live drive ends with {done.returncode}: {done.stderr}")
        (run,) = (out / "runs").iterdir()
        return read_live_drive(run)


def read_live_drive(run: Path) -> LiveDrive:
    """Return what the folder of a traced drive tells."""
    record = json.loads((run / "run.json").read_bytes())
    events = json.loads((run / "trace.json").read_bytes())["traceEvents"]
    rows = pq.read_table(run / "results" / "rounds.parquet").to_pylist()
    settled = {row["round_id"]: row for row in rows if row["drive_time_s"] >= SETTLED_S}
    jobs = _jobs_of_rounds(events)
    cpu_ms = [jobs[number] for number in settled if number in jobs]
    wall_ms = sorted(row["latency_ms"] for row in settled.values())
    return LiveDrive(
        rounds=len(settled),
        wall_ms=statistics.median(wall_ms),
        jobs_cpu_ms=statistics.median(sum(each) for each in cpu_ms),
        slowest_job_cpu_ms=statistics.median(max(each) for each in cpu_ms),
        orchestrator_cpu_ms=_own_ms(events),
        p95_ms=statistics.quantiles(wall_ms, n=20)[-1],
        late=sum(row["late"] for row in settled.values()),
        missed=record["ledger"]["rounds"]["missed"],
        least_futures=min(row["futures"] for row in settled.values()),
        shares={name: each["share_of_core"] or 0.0 for name, each in record["processor"].items()},
    )


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
