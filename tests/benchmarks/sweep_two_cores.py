"""A sweep on two workers against one, in turn: futures a second, and where the time goes."""

from __future__ import annotations

import os
import statistics
import tempfile
from pathlib import Path

from tests.benchmarks.measuring import Measurement, UnavailableError
from tests.scale.sweep_runs import SweepRun, play
from tests.scale.workload import MANY_VEHICLES, Workload

PAIRS = 3
FUTURES_PER_JOB = 64


def measure() -> Measurement:
    """Return futures a second of two workers and of one, as on idle cores.

    That is by the wall less what jobs were kept from a processor, medians of interleaved pairs:
    idle workers, waiting for the parent, Worlds compiled twice and neighbours that slow each other
    all count. `speed_up_wall` is by the wall alone, `speed_up_cpu` by what CPU time a future takes,
    and `others_cores` says how busy the machine was: beside others, one worker has a neighbour too.
    """
    if (os.cpu_count() or 1) < 2:
        raise UnavailableError("one core only")
    with tempfile.TemporaryDirectory() as name:
        load = Workload(Path(name), FUTURES_PER_JOB, MANY_VEHICLES)
        pairs: list[tuple[SweepRun, SweepRun]] = []
        for number in range(PAIRS):
            runs = {
                workers: play(load, f"{workers}-{number}", workers=workers)
                for workers in ((1, 2) if number % 2 else (2, 1))
            }
            pairs.append((runs[1], runs[2]))
    ones, twos = zip(*pairs, strict=True)
    gaps_s = [
        gap for run in twos for worker in run.by_worker().values() for gap in worker.gaps_s[1:]
    ]
    wire_s = [run.parts_s["decode a job"] + run.parts_s["encode an answer"] for run in twos]
    median = statistics.median
    return Measurement(
        load.futures / median(run.unhindered_s for run in twos),
        "futures per s",
        load.futures / median(run.unhindered_s for run in ones),
        {
            "speed_up_wall": median(one.makespan_s / two.makespan_s for one, two in pairs),
            "speed_up_cpu": median(2.0 * one.jobs_cpu_s / two.jobs_cpu_s for one, two in pairs),
            "idle_share_of_two": median(run.idle_share for run in twos),
            "between_jobs_ms": 1e3 * median(gaps_s),
            "wire_ms": 1e3 * median(wire_s),
            "parent_cpu_ms_per_job": 1e3 * median(r.parent_cpu_s / len(r.jobs) for r in twos),
            "others_cores": median(run.others_cores for run in ones + twos),
        },
    )
