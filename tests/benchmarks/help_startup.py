"""How long a user waits for `foretwin --help`, against an interpreter that does nothing."""

from __future__ import annotations

import subprocess
import sys

from tests.benchmarks.measuring import Measurement, wall_minimum_s

REPEATS = 8


def measure() -> Measurement:
    """Return wall seconds of `foretwin --help` against `python -c pass`."""

    def run(*arguments: str) -> None:
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)

    value, baseline = float("inf"), float("inf")
    for _ in range(REPEATS):
        value = min(value, wall_minimum_s(lambda: run("-m", "foretwin", "--help"), repeats=1))
        baseline = min(baseline, wall_minimum_s(lambda: run("-c", "pass"), repeats=1))
    return Measurement(value, "s", baseline)
