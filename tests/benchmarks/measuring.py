"""What a benchmark returns, and how times are taken: minima over repeats, since noise only adds."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple


class UnavailableError(RuntimeError):
    """The benchmark cannot run on this machine; the text says what is missing."""


class Measurement(NamedTuple):
    """A value and what it is held against, in the same unit and from the same run.

    `more` holds further figures of that run.
    """

    value: float
    unit: str
    baseline: float
    more: Mapping[str, float] = MappingProxyType({})

    def as_row(self) -> dict[str, float | str]:
        """Return the entry of `build/bench.json`."""
        row = {"value": self.value, "unit": self.unit, "baseline": self.baseline}
        return {**row, "ratio": self.value / self.baseline, **self.more}


def cpu_seconds(work: Callable[[], object]) -> float:
    """Return the CPU seconds, over all threads of this process, that `work` takes."""
    return _taken(work, time.process_time)


def cpu_minimum_s(work: Callable[[], object], *, repeats: int) -> float:
    """Return the fewest CPU seconds, over all threads of this process, that `work` took."""
    return min(cpu_seconds(work) for _ in range(repeats))


def wall_minimum_s(work: Callable[[], object], *, repeats: int) -> float:
    """Return the fewest wall seconds that `work` took."""
    return min(_taken(work, time.perf_counter) for _ in range(repeats))


def _taken(work: Callable[[], object], clock: Callable[[], float]) -> float:
    start = clock()
    work()
    return clock() - start
