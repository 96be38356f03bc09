"""`python -m tests.benchmarks.pairs BASE_REV [NAME ...]` measures two revisions in turn.

The base is checked out beside the working tree; each pair measures base and head one after the
other, in changing order, after one measurement of each that does not count. What is compared is a
benchmark's ratio to its own baseline of the same run. Exit code 3 where the interval says that head
is worse.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from scipy.stats import t as student

WORSE = 3
MORE_IS_BETTER = ("simulated s per CPU s", "steps per CPU s")
ROOT = Path(__file__).parents[2]


class Change(NamedTuple):
    """Head over base: the geometric mean of the pairs' ratios, and its 95 % interval."""

    factor: float
    low: float
    high: float


def main(arguments: Sequence[str]) -> int:
    """Measure, and print of each benchmark how head's ratio stands to base's."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.pairs", description=__doc__)
    parser.add_argument("base", metavar="BASE_REV")
    parser.add_argument("names", nargs="+", metavar="NAME")
    parser.add_argument("--pairs", type=int, default=5)
    asked = parser.parse_args(arguments)
    worse = False
    with tempfile.TemporaryDirectory(prefix="pairs-") as folder:
        tree = Path(folder) / "tree"
        add = ["git", "worktree", "add", "-q", "--detach", str(tree), asked.base]
        subprocess.run(add, cwd=ROOT, check=True)
        try:
            for name in asked.names:
                pairs = [ratios(name, tree, number) for number in range(asked.pairs + 1)][1:]
                found = change([head / base for base, head in pairs])
                print(f"{name:28} {found.factor:.3f} of base ({found.low:.3f}-{found.high:.3f})")
                sys.stdout.flush()
                worse |= found.low > 1.0
        finally:
            remove = ["git", "worktree", "remove", "--force", str(tree)]
            subprocess.run(remove, cwd=ROOT, check=True)
    return WORSE if worse else 0


def ratios(name: str, base: Path, number: int) -> tuple[float, float]:
    """Measure base and head, in an order that changes; returns both ratios."""
    trees = (base, ROOT)
    measured = {tree: _ratio(name, tree) for tree in (trees if number % 2 else trees[::-1])}
    return measured[base], measured[ROOT]


def _ratio(name: str, tree: Path) -> float:
    """Measure in a tree; returns what grows as things get slower."""
    environment = os.environ | {"PYTHONPATH": str(tree)}
    command = [sys.executable, "-m", "tests.benchmarks", name]
    subprocess.run(command, cwd=tree, env=environment, check=True, stdout=subprocess.DEVNULL)
    row = json.loads((tree / "build" / "bench.json").read_text(encoding="utf-8"))[name]
    ratio = row["value"] / row["baseline"]
    return 1.0 / ratio if row["unit"] in MORE_IS_BETTER else float(ratio)


def change(factors: Sequence[float]) -> Change:
    """Return the geometric mean of factors, and Student's 95 % interval of their logarithms."""
    logs = [math.log(factor) for factor in factors]
    middle = statistics.fmean(logs)
    half = student.ppf(0.975, len(logs) - 1) * statistics.stdev(logs) / math.sqrt(len(logs))
    return Change(math.exp(middle), math.exp(middle - half), math.exp(middle + half))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
