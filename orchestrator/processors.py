"""The processors that this process may use, and how many workers they are good for."""

from __future__ import annotations

import os

_LEAST_BOUND, _PER_PROCESSOR = 16, 4


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def most_workers() -> int:
    """Return how many worker processes may be asked for.

    A worker computes all the time, so that more than one a processor only share it. Four leave room
    for planners that wait for others, and sixteen let one configuration serve many machines.
    """
    return max(_LEAST_BOUND, _PER_PROCESSOR * processors())


def trouble_with_workers(workers: int) -> str | None:
    """Return what is wrong with a number of workers, None where nothing is."""
    if 1 <= workers <= most_workers():
        return None
    return (
        f"--workers {workers}: 1 to {most_workers()} here, {_PER_PROCESSOR} a processor and never "
        f"fewer than {_LEAST_BOUND}"
    )
