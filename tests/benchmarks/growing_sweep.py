"""`python -m tests.benchmarks.growing_sweep CELLS OUT` sweeps so many cells with seats that compute
nothing, and says what the command that holds the sweep takes: memory, and CPU time a job.

Ended before its end, the same command goes on where it stopped. `--workers 0` walks the plan and
makes every job, and has none played.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.one_heap import share_one_heap
from foretwin.contracts.owned_folder import temporary_folder
from foretwin.contracts.placement import PlacedHere, WorldPlaces
from foretwin.contracts.runner import Answer
from foretwin.contracts.setup import ProcessSetup
from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.runner.launch import Child, FreshInterpreter
from foretwin.orchestrator.runner.worker_processes import WorkerProcesses
from foretwin.orchestrator.sweep.jobs import JobMaker
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.orchestrator.sweep.workers import worker_setup

ROOT = Path(__file__).parents[2]
TOLD = 20
"""How often memory is told."""
STARTED = 100
"""Answers that do not count for the time: as they come, libraries are loaded."""
SPEC = """
worlds = "{{worlds}}"
scenarios = ["ccftap"]
planners = ["pure_pursuit_idm", "constant_speed"]
horizon_s = 2.0

[parameters]
friction_factor = {frictions}
target_speed_factor = {speeds}
"""
CELLS_A_SET = 18
"""Nine cases of two planners."""


class ReplayingSeats:
    """Starts seats that compute nothing in place of workers."""

    def __init__(self, folder: Path) -> None:
        self._launch = FreshInterpreter(folder, package="tests.benchmarks")

    def __call__(self, *, module: str, setup: ProcessSetup) -> Child:
        """Start one."""
        return self._launch(module="replaying_seat", setup=setup)


class Watched(WorkerProcesses):
    """Tells of this process as answers come."""

    every, taken = 1, 0
    since_s: tuple[int, float] = (0, 0.0)
    """After how many answers all was imported, and what CPU time had been taken by then."""

    def take(self, timeout_s: float | None = 0.0) -> Answer | None:
        """Return one answer; see WorkerProcesses."""
        answer = super().take(timeout_s)
        if answer is not None:
            self.taken += 1
            if self.taken == STARTED:
                self.since_s = self.taken, time.process_time()
            if self.taken % self.every == 1 % self.every:
                print(f"{self.taken:8d} answers: {memory_mb('VmRSS'):.1f} MB", flush=True)
        return answer


def memory_mb(name: str) -> float:
    """Return what Linux says of this process's memory: VmRSS now, VmHWM at most."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.partition(f"{name}:")[2].split()[0]) / 1024.0


def spec_of(cells: int, folder: Path) -> Path:
    """Write a sweep of at least so many cells, and its World."""
    side = math.ceil(math.sqrt(cells / CELLS_A_SET))
    frictions, speeds = (
        [round(low + 0.2 * n / side, 7) for n in range(side)] for low in (0.7, 0.8)
    )
    folder.mkdir(parents=True, exist_ok=True)
    # In a process of its own: what draws the World is no part of the command.
    spec = SPEC.format(frictions=frictions, speeds=speeds)
    drawing = "import sys, pathlib; from tests.orchestrator.sweeps import small_sweep; "
    drawing += "print(small_sweep(pathlib.Path(sys.argv[1]), sys.stdin.read()))"
    drawn = subprocess.run(
        [sys.executable, "-c", drawing, str(folder.resolve())],
        cwd=ROOT, input=spec, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return Path(drawn.stdout.strip())


def measured(cells: int, folder: Path, *, workers: int) -> dict[str, float | str]:
    """Sweep, and return what it took of this process."""
    os.environ["PYTHONPATH"] = str(ROOT)  # for the seats
    share_one_heap()  # as the command does
    loaded, out = load_spec(spec_of(cells, folder)), folder / "out"
    with (
        temporary_folder("foretwin-sweep-") as files,
        Watched(
            workers, worker_setup(loaded, out), task_timeout_s=60.0, folder=files,
            launch=ReplayingSeats(files),
        ) as runner,
    ):  # fmt: skip
        Watched.every = max(1, cells // 64 // TOLD)
        begun_s = time.perf_counter()
        summary = run_sweep(loaded, out, runner)
        wall_s = time.perf_counter() - begun_s
        started, started_s = runner.since_s
        cpu_s = (time.process_time() - started_s) / max(runner.taken - started, 1)
    return {
        "cells": summary["rows"],
        "jobs": summary["jobs"],
        "jobs_played": summary["jobs_played"],
        "failed": summary["failed"],
        "most_mb": round(memory_mb("VmHWM"), 1),
        "cpu_ms_a_job": round(1e3 * cpu_s, 3),
        "wall_s": round(wall_s, 1),
        "rows_sha256": summary["rows_sha256"],
    }


def walked(cells: int, folder: Path) -> dict[str, float | str]:
    """Make all jobs of a sweep one after the other, and return what it took of this process."""
    loaded = load_spec(spec_of(cells, folder))
    worlds = [path.stem for path in (folder / "drawn").glob("*.world")]
    placed = tuple(
        WorldPlaces(
            world_id=world_id,
            frame=LocalFrame(GeoPoint(52.5, 13.4)),
            placed=(PlacedHere(scenario_id="ccftap", junction_id="n0", place="a/b", ego="a"),),
            unplaced=(),
            ways={"a": PathAhead(xy_m=np.zeros((300, 2)), speed_limit_mps=np.zeros(300))},
        )
        for world_id in worlds
    )
    before_mb, begun_s = memory_mb("VmRSS"), time.process_time()
    plan, maker = SweepPlan(loaded, placed), JobMaker(loaded)
    names = sum(len(job_bytes(maker.job(planned)).sha256) for planned in plan.planned()) // 64
    cpu_s = time.process_time() - begun_s
    return {
        "cells": plan.cells,
        "jobs": names,
        "before_mb": round(before_mb, 1),
        "most_mb": round(memory_mb("VmHWM"), 1),
        "cpu_ms_a_job": round(1e3 * cpu_s / names, 3),
    }


def main(arguments: Sequence[str]) -> int:
    """Sweep and print what it took as JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.growing_sweep")
    parser.add_argument("cells", type=int)
    parser.add_argument("out", type=Path)
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args(arguments)
    if asked.workers:
        told = measured(asked.cells, asked.out, workers=asked.workers)
    else:
        told = walked(asked.cells, asked.out)
    print(json.dumps(told, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
