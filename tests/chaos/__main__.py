"""`python -m tests.chaos`: drives that things happen to, until so many faults have happened.

Each drive is drawn from the seed, which is printed, and its number. Exit code 0 where all that must
hold of each drive held, else 3, with seed, faults and the folder of each that failed.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import time
from collections import Counter
from collections.abc import Sequence

from tests.chaos.drive import Outcome, carry_out
from tests.chaos.faults import draw

FAILED = 3


def main(arguments: Sequence[str]) -> int:
    """Drive, print a line of each drive, and what failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description=__doc__)
    parser.add_argument("--count", type=int, default=60, help="faults that must have happened")
    parser.add_argument("--seed", type=int, default=0, help="0: a fresh one")
    parser.add_argument("--drive", type=int, default=None, help="one drive of the seed alone")
    asked = parser.parse_args(arguments)
    seed = asked.seed or random.SystemRandom().randrange(1, 10**6)
    for number in (signal.SIGHUP, signal.SIGINT):
        # Under nohup, or in the background, all that is started would ignore them, too.
        signal.signal(number, signal.default_int_handler)
    print(f"seed {seed}", flush=True)
    return 0 if run(seed, count=asked.count, only=asked.drive) else FAILED


def run(seed: int, *, count: int, only: int | None = None) -> bool:
    """Carry out drives until `count` faults have happened; returns whether all was well."""
    happened, skipped, failed, drives = Counter[str](), Counter[str](), 0, 0
    begun_s = time.monotonic()
    while drives == 0 or (only is None and happened.total() < count):
        outcome = carry_out(draw(seed, drives if only is None else only), keep=only is not None)
        drives += 1
        happened.update(one.fault.what for one in outcome.done)
        skipped.update(what.split()[2] for what in outcome.skipped)
        failed += bool(outcome.wrong)
        print(line_of(outcome), flush=True)
    taken_s = time.monotonic() - begun_s
    print(
        f"{happened.total()} faults in {drives} drives, {failed} of them failed, {taken_s:.0f} s; "
        + ", ".join(f"{what} {number}" for what, number in sorted(happened.items()))
    )
    if skipped:
        print(f"not possible there: {dict(skipped)}")
    return not failed


def line_of(outcome: Outcome) -> str:
    """Return one line, or of a failure all that is needed to have it again."""
    kind = "linked" if outcome.case.linked else "town"
    line = (
        f"{outcome.case.name} {kind}: {len(outcome.done)} faults, exit {outcome.code}, "
        f"{outcome.wall_s:.0f} s"
    )
    if not outcome.wrong:
        return line
    return "\n".join([
        f"{line}: FAILED, see {outcome.folder}",
        *(f"    {one}" for one in outcome.done),
        *(f"    wrong: {one}" for one in outcome.wrong),
    ])  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
