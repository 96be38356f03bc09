"""Two processes that run jobs at the same time, against one that runs alone."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection

import numpy as np

from tests.benchmarks.closed_loop import SECONDS, flat_job
from tests.benchmarks.measuring import Measurement, UnavailableError

REPEATS = 20
WITHIN_S = 120.0


def measure() -> Measurement:
    """Return simulated seconds per second of two processes, as they would run on idle cores.

    That is by CPU time: what waits for a core is not counted, but what two cores take from each
    other is. `ratio_wall` is by the clock on the wall, the same on idle cores alone.
    """
    if (os.cpu_count() or 1) < 2:
        raise UnavailableError("one core only")
    spawn = multiprocessing.get_context("spawn")
    ours, theirs = zip(*(spawn.Pipe() for _ in range(2)), strict=True)
    processes = [spawn.Process(target=_work, args=(end,), daemon=True) for end in theirs]
    for process in processes:
        process.start()
    try:
        _run(ours)
        alone = [_run(ours[turn % 2 :][:1]) for turn in range(REPEATS)]
        together = [_run(ours) for _ in range(REPEATS)]
    finally:
        for process in processes:
            process.kill()
            process.join()
    (one_s, one_wall_s), (two_s, two_wall_s) = (
        np.min(taken, axis=0) for taken in (alone, together)
    )
    return Measurement(
        float(2.0 * SECONDS / two_s), "simulated s per CPU s of the slower", float(SECONDS / one_s),
        {"ratio_wall": float(2.0 * one_wall_s / two_wall_s)},
    )  # fmt: skip


def _run(ends: Sequence[Connection]) -> tuple[float, float]:
    """Let these processes run a job each; return CPU seconds of the slower, and wall seconds."""
    start = time.perf_counter()
    for end in ends:
        end.send(None)
    taken = []
    for end in ends:
        if not end.poll(WITHIN_S):
            raise RuntimeError(f"no job done within {WITHIN_S:g} s")
        taken.append(end.recv())
    return max(taken), time.perf_counter() - start


def _work(end: Connection) -> None:
    _, run = flat_job(20.0)
    while True:
        end.recv()
        start = time.process_time()
        run()
        end.send(time.process_time() - start)
