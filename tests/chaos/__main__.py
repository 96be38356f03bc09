"""`python -m tests.chaos`: drives that things happen to, until so many faults have happened.

Each drive is drawn from the seed, which is printed, and its number. What became of each stands in
build/chaos/SEED.jsonl, so that `--from` goes on where another call was ended, and the table at the
end is of all of them. Exit code 0 where all that must hold of each drive held, else 3, with seed,
faults and the folder of each that failed.
"""

from __future__ import annotations

import argparse
import math
import random
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from tests.chaos.drive import Outcome, carry_out
from tests.chaos.faults import draw
from tests.chaos.table import DriveLine, keep, kept, table_of
from tests.system.foretwin_command import REPOSITORY

FAILED = 3


def main(arguments: Sequence[str]) -> int:
    """Drive, print a line of each drive, and what failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description=__doc__)
    parser.add_argument("--count", type=int, default=60, help="faults that must have happened")
    parser.add_argument("--seed", type=int, default=0, help="0: a fresh one")
    parser.add_argument("--from", type=int, default=0, dest="first", help="number of a drive")
    parser.add_argument("--within-s", type=float, default=math.inf, help="begin no drive after")
    parser.add_argument("--drive", type=int, default=None, help="one drive of the seed alone")
    asked = parser.parse_args(arguments)
    seed = asked.seed or random.SystemRandom().randrange(1, 10**6)
    for number in (signal.SIGHUP, signal.SIGINT):
        # Under nohup, or in the background, all that is started would ignore them, too.
        signal.signal(number, signal.default_int_handler)
    print(f"seed {seed}", flush=True)
    if asked.drive is not None:
        outcome = carry_out(draw(seed, asked.drive), keep=True)
        print(text_of(outcome, always=True))
        return FAILED if outcome.wrong else 0
    file = REPOSITORY / "build" / "chaos" / f"{seed}.jsonl"
    until_s = time.monotonic() + asked.within_s
    well = run(seed, count=asked.count, first=asked.first, file=file, until_s=until_s)
    return 0 if well else FAILED


def run(seed: int, *, count: int, file: Path, first: int = 0, until_s: float = math.inf) -> bool:
    """Carry out drives until `count` faults have happened in all of the seed's, or the time is
    over, and print the table of those; returns whether all was well."""
    drives = {number: one for number, one in kept(file).items() if number < first}
    revision = _revision()
    try:
        while sum(len(one.done) for one in drives.values()) < count:
            if time.monotonic() > until_s:
                raise KeyboardInterrupt
            number = max(first, max(drives, default=-1) + 1)
            outcome = carry_out(draw(seed, number))
            drives[number] = _line(outcome, revision)
            keep(file, drives[number])
            print(text_of(outcome), flush=True)
    except KeyboardInterrupt:
        print(f"ended; --seed {seed} --from {max(drives, default=-1) + 1} goes on")
    print(table_of(drives.values()))
    return not any(one.wrong for one in drives.values())


def text_of(outcome: Outcome, *, always: bool = False) -> str:
    """Return one line, or of a failure all that is needed to have it again."""
    line = (
        f"{outcome.case.name} {outcome.case.kind}: {len(outcome.done)} faults, "
        f"exit {outcome.code}, {outcome.wall_s:.0f} s"
    )
    if not outcome.wrong and not always:
        return line
    end = f"FAILED, see {outcome.folder}" if outcome.wrong else f"see {outcome.folder}"
    return "\n".join([
        f"{line}: {end}",
        *(f"    {one}" for one in outcome.done),
        *(f"    not possible: {one}" for one in outcome.skipped),
        *(f"    wrong: {one}" for one in outcome.wrong),
    ])  # fmt: skip


def _line(outcome: Outcome, revision: str) -> DriveLine:
    return DriveLine(
        number=outcome.case.number, kind=outcome.case.kind, revision=revision, code=outcome.code,
        wall_s=outcome.wall_s, done=outcome.done, skipped=outcome.skipped, wrong=outcome.wrong,
    )  # fmt: skip


def _revision() -> str:
    """Return what is played: HEAD, with a + where the working tree differs."""
    asked = ("git", "describe", "--always", "--dirty=+")
    told = subprocess.run(asked, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    return told.stdout.strip() or "unknown"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
