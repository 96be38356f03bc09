"""What a job of 64 futures costs beside its computing, on Ray and, in turn, on worker processes.

Both carry a real job to one worker that computes nothing, and a real finished part back. Needs root
and RAY_VENV, an environment with foretwin[ray]: Ray gets a network of its own.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import encode
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.runner import Runner, Task, answers, job_task
from foretwin.contracts.setup import ProcessSetup, WorkerSetup
from foretwin.orchestrator.runner.launch import Child, FreshInterpreter
from foretwin.orchestrator.runner.ray_cluster import ray_cluster
from foretwin.orchestrator.runner.ray_runner import RayRunner
from foretwin.orchestrator.runner.worker_processes import WorkerProcesses
from foretwin.orchestrator.sweep.jobs import JobMaker, cells_of
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.spec import FUTURES_PER_JOB, load_spec
from foretwin.orchestrator.sweep.workers import worker_setup
from foretwin.sim_worker.seat import SeatAnswer, SeatQuestion, SeatSetup
from tests.benchmarks.canned_worker import ANSWER, answer_here
from tests.benchmarks.measuring import Measurement, UnavailableError
from tests.orchestrator.sweeps import alone, places_of, small_sweep
from tests.system.foretwin_command import REPOSITORY
from tests.system.ray_nodes import RayNodes

JOBS, REPEATS = 200, 7
TIMEOUT_S = 60.0
FULL = """
worlds = "{worlds}"
scenarios = ["cpta"]
planners = ["pure_pursuit_idm"]
horizon_s = 5.0
[parameters]
friction_factor = [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3]
target_speed_factor = [0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05]
"""


def measure() -> Measurement:
    """Return milliseconds a job on Ray, against those on a worker process: medians of blocks."""
    try:
        with RayNodes(1) as machine:
            found = machine.run("-m", "tests.benchmarks.ray_overhead", check=True)
    except pytest.skip.Exception as missing:
        raise UnavailableError(str(missing)) from missing
    by_ray, by_zenoh, job_bytes_, answer_bytes = json.loads(found.stdout.splitlines()[-1])
    (ray_ms, ray_cpu_ms), (zenoh_ms, zenoh_cpu_ms) = (
        zip(*blocks, strict=True) for blocks in (by_ray, by_zenoh)
    )
    return Measurement(
        float(np.median(ray_ms)),
        "ms a job of 64 futures",
        float(np.median(zenoh_ms)),
        {
            "fewest_ray": min(ray_ms),
            "most_ray": max(ray_ms),
            "fewest_zenoh": min(zenoh_ms),
            "most_zenoh": max(zenoh_ms),
            "parents_cpu_ray": float(np.median(ray_cpu_ms)),
            "parents_cpu_zenoh": float(np.median(zenoh_cpu_ms)),
            "load": os.getloadavg()[0],
            "job_bytes": job_bytes_,
            "answer_bytes": answer_bytes,
        },
    )


class Taken(NamedTuple):
    """What a job took from question to answer, of many on their way at once."""

    wall_ms: float
    cpu_ms: float
    """Of the process that asks: what holds on a busy machine too."""


def taken(runner: Runner, made: list[Task]) -> Taken:
    """Let all jobs be answered once; returns what one of them took."""
    start_s, cpu_s = time.perf_counter(), time.process_time()
    for answer in answers(runner, made):
        assert answer.message is not None, answer.failure
    each_ms = 1e3 / len(made)
    return Taken(each_ms * (time.perf_counter() - start_s), each_ms * (time.process_time() - cpu_s))


def jobs_of_64(folder: Path) -> tuple[list[Task], WorkerSetup]:
    """Return as many jobs as a block has, and put the answer to the first into the folder."""
    loaded = load_spec(small_sweep(folder, FULL))
    here = alone(loaded)
    world_id = next((folder / "drawn").glob("*.world")).stem
    plan = SweepPlan(loaded, [places_of(here, loaded, world_id)])
    planned = next(job for job in plan.planned() if len(job.cells) == FUTURES_PER_JOB)
    job = JobMaker(loaded).job(planned)
    cells = cells_of(planned, plan.attribution)
    numbered = (msgspec.structs.replace(job, job_index=number) for number in range(JOBS))
    made = [job_task(one, job_bytes(one), cells=cells) for one in numbered]
    (answer,) = answers(here, made[:1])
    (folder / ANSWER).write_bytes(encode(answer.message))
    return made, msgspec.structs.replace(worker_setup(loaded, folder), worlds_dir=str(folder))


class _CannedWorkers:
    def __init__(self, folder: Path) -> None:
        self._launch = FreshInterpreter(folder, package="tests.benchmarks")

    def __call__(self, *, module: str, setup: ProcessSetup) -> Child:
        return self._launch(module="canned_worker", setup=setup)


def _answer_of_nobody(
    setup: bytes, question: SeatQuestion, world: bytes | None
) -> tuple[str, SeatAnswer]:
    """Answer as a seat does, with no node's id."""
    return "", answer_here(setup, question, world)


@contextlib.contextmanager
def on_ray(folder: Path, setup: WorkerSetup) -> Iterator[Runner]:
    """Give a runner on a Ray of its own, with one seat that is canned."""
    seat = SeatSetup(worker=setup, made_of={}, limit_s=TIMEOUT_S)
    (world,) = (folder / "drawn").glob("*.world")
    with ray_cluster(seat, address=None, processors=1) as cluster:
        import ray

        cluster._answer = ray.remote(num_cpus=1)(_answer_of_nobody)
        cluster._setup = ray.put(str(folder).encode())
        yield RayRunner(cluster, world_file=lambda _: world.read_bytes(), task_timeout_s=TIMEOUT_S)


def main(folder: Path) -> None:
    """Print the figures of both, block by block in turn."""
    made, setup = jobs_of_64(folder)
    processes = folder / "processes"
    with (
        WorkerProcesses(
            1, setup, task_timeout_s=TIMEOUT_S, folder=processes, launch=_CannedWorkers(processes)
        ) as zenoh,
        on_ray(folder, setup) as ray,
    ):
        for runner in ray, zenoh:
            taken(runner, made)  # Until both are there and warm.
        by_ray, by_zenoh = zip(
            *((taken(ray, made), taken(zenoh, made)) for _ in range(REPEATS)), strict=True
        )
    answer = (folder / ANSWER).stat().st_size
    print(json.dumps([by_ray, by_zenoh, len(encode(made[0].question)), answer]), flush=True)


if __name__ == "__main__":
    os.environ["PYTHONPATH"] = str(REPOSITORY)
    with tempfile.TemporaryDirectory() as temporary:
        main(Path(temporary))
    sys.exit(0)
