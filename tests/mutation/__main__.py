"""`python -m tests.mutation` changes the program in many small ways and says which of them no test
notices.

Mutants are drawn by cosmic-ray (MIT), which is installed into an environment of its own when it is
first needed, over contracts, the gateway and the rounds. Each stands in a checkout of HEAD alone,
where the tests run that mirror its module or name it in COVERS. One more is planted and must be
noticed. Exit code 0 where at least 85 % are killed, 3 where fewer are or the planted one lives.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import subprocess
import sys
import venv
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tests.mutation.noticing import Checkout, Fate, checkout, files_of
from tests.test_layout import ROOT
from tests.test_mirrored import modules

TOOL = "cosmic-ray==8.7.0"
ROOMS = ("foretwin.contracts.", "foretwin.telemetry.ros2.", "foretwin.orchestrator.rounds.")
LEAST_KILLED = 0.85
UNNOTICED = 3
DEAD: tuple[Fate, ...] = ("killed", "timed out")


class Mutant(NamedTuple):
    """A module changed in one place: how, the line as it was and as it is, and its whole text."""

    module: str
    line: int
    operator: str
    before: str
    after: str
    text: str

    def __str__(self) -> str:
        where = f"{self.module}:{self.line} {self.operator}"
        return f"{where}\n      - {self.before.strip()}\n      + {self.after.strip()}"


class Report(NamedTuple):
    """What became of the mutants drawn, and of the planted one."""

    fates: list[tuple[Mutant, Fate]]
    planted: Fate

    @property
    def killed(self) -> float:
        """The share that tests noticed, or that never came to an end."""
        dead = sum(fate in DEAD for _, fate in self.fates)
        return dead / max(1, len(self.fates))

    @property
    def error(self) -> float:
        """The standard error of that share: the mutants are a sample."""
        return math.sqrt(self.killed * (1.0 - self.killed) / max(1, len(self.fates)))


def planted() -> Mutant:
    """Return the mutant that must be noticed: the dead man waits a thousand times as long."""
    module, before = "foretwin.telemetry.ros2.safety", "DEAD_MAN_NS = 150_000_000\n"
    text = modules()[module].read_text(encoding="utf-8")
    if before not in text:
        raise RuntimeError(f"{module} no longer says {before.strip()!r}: plant another mutant")
    after = before.replace("150_", "150_000_")
    return Mutant(module, 0, "planted", before, after, text.replace(before, after))


def draw(seed: int, count: int) -> list[Mutant]:
    """Draw mutants of the modules that have tests; the same for the same seed and tree."""
    names = {
        str(path.relative_to(ROOT)): name
        for name, path in sorted(modules().items())
        if name.startswith(ROOMS) and files_of(name)
    }
    asked = {"root": str(ROOT), "files": list(names), "seed": seed, "count": count}
    told = subprocess.run(
        [_tool(), ROOT / "tests" / "mutation" / "draw_mutants.py"],
        input=json.dumps(asked), capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    found = []
    for one in json.loads(told)["mutants"]:
        was = (ROOT / one["file"]).read_text(encoding="utf-8").splitlines()
        now = one["text"].splitlines()
        line = next((n for n, pair in enumerate(zip(was, now, strict=False)) if pair[0] != pair[1]),
                    one["line"] - 1)  # fmt: skip
        after = now[line] if len(now) == len(was) else "(the line is gone)"
        found.append(
            Mutant(names[one["file"]], line + 1, one["operator"], was[line], after, one["text"])
        )
    return found


def try_all(mutants: Sequence[Mutant], tree: Checkout) -> list[tuple[Mutant, Fate]]:
    """Try mutants one after the other, and tell of each that lives."""
    fates = []
    for number, mutant in enumerate(mutants):
        fate = tree.fate(mutant.module, mutant.text)
        fates.append((mutant, fate))
        if fate != "killed":
            print(f"{number + 1:4d} {fate} {mutant}", flush=True)
    return fates


def run(seed: int, count: int, *, after: int = 0) -> Report:
    """Draw mutants, try those after the first so many, and print what became of them and how many
    of each room were killed."""
    print(f"seed {seed}, {count} after {after}", flush=True)
    mutants = draw(seed, after + count)[after:]
    with checkout() as tree:
        first = tree.fate(planted().module, planted().text)
        print(f"planted: {first}", flush=True)
        report = Report(try_all(mutants, tree), first)
    for room in ROOMS:
        fates = [fate for mutant, fate in report.fates if mutant.module.startswith(room)]
        print(f"{room:31s}{sum(fate in DEAD for fate in fates):4d} of {len(fates)}")
    counts = Counter(fate for _, fate in report.fates)
    share = f"{100.0 * report.killed:.1f} ± {100.0 * report.error:.1f} %"
    print(f"{share} of {len(mutants)} mutants are killed: {dict(counts)}")
    return report


def _tool() -> Path:
    """Return the Python that has cosmic-ray; installs it where there is none yet."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "foretwin-mutation" / TOOL.replace("==", "-")
    python = folder / "bin" / "python"
    done = folder / "installed"
    if not done.exists():
        venv.create(folder, with_pip=True, clear=True)
        pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", TOOL]
        subprocess.run(pip, check=True, capture_output=True)
        done.touch()
    return python


def main(arguments: Sequence[str]) -> int:
    """Draw and try as many mutants as are asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0, help="0: a fresh one")
    parser.add_argument("--after", type=int, default=0, help="go on after so many of this seed")
    asked = parser.parse_args(arguments)
    seed = asked.seed or random.SystemRandom().randrange(1, 10**6)
    report = run(seed, asked.count, after=asked.after)
    noticed = report.planted == "killed" and report.killed >= LEAST_KILLED
    return 0 if noticed else UNNOTICED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
