"""`python -m tests.same_bits BASE_REV [--parts worlds,drive,sweep] [--quick]` compares two trees.

The base revision is checked out beside the working tree, and both run the same commands. Exit code
0 where all results are the same bits, 3 where they are not or a side fails, 2 for a wrong request,
130 where it was told to end.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tests.same_bits.comparison import Compared, compare, table
from tests.same_bits.drives import compare_drives
from tests.same_bits.sides import SideError, two_sides
from tests.same_bits.sweeps import compare_sweeps
from tests.same_bits.worlds import compare_worlds

PARTS = {"worlds": compare_worlds, "drive": compare_drives, "sweep": compare_sweeps}
DIFFERENT, WRONG_REQUEST, INTERRUPTED = 3, 2, 130


def main(arguments: Sequence[str]) -> int:
    """Compare, print the table, and return the exit code."""
    asked = _parser().parse_args(arguments)
    names = asked.parts.split(",")
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        print(f"unknown part {', '.join(unknown)}; known: {', '.join(PARTS)}", file=sys.stderr)
        return WRONG_REQUEST
    given = os.environ.get("FORETWIN_DATA")
    data = None if given is None else Path(given).resolve()
    if data is None:
        print("FORETWIN_DATA is not set: the drawn town alone, no real map and no real drive")
    scratch = Path(tempfile.mkdtemp(prefix="same-bits-"))
    results: list[Compared] = []
    failures = []
    try:
        with two_sides(asked.base, scratch) as sides:
            for name in names:
                start_s, cpu_start_s = time.monotonic(), _cpu_s()
                try:
                    sections = PARTS[name](sides, data=data, quick=asked.quick, seed=asked.seed)
                except SideError as error:
                    failures.append(f"{name}: {error}")
                else:
                    results += map(compare, sections)
                took_s, cpu_s = time.monotonic() - start_s, _cpu_s() - cpu_start_s
                print(f"{name}: {took_s:.0f} s, {cpu_s:.0f} s of CPU on both sides", flush=True)
    except SideError as error:
        print(error, file=sys.stderr)
        return WRONG_REQUEST
    except KeyboardInterrupt:
        print("interrupted: nothing is known", file=sys.stderr)
        return INTERRUPTED
    finally:
        if not asked.keep:
            shutil.rmtree(scratch, ignore_errors=True)
    print(table(results))
    for failure in failures:
        print(f"failed: {failure}")
    if asked.keep:
        print(f"kept: {scratch}")
    same = not failures and all(result.same for result in results)
    print("all the same bits" if same else "NOT the same")
    return 0 if same else DIFFERENT


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.same_bits", description=__doc__)
    parser.add_argument("base", metavar="BASE_REV", help="what the working tree is compared with")
    parser.add_argument("--parts", default=",".join(PARTS), help="some of %(default)s")
    parser.add_argument("--quick", action="store_true", help="fewer places and shorter drives")
    parser.add_argument("--seed", type=int, default=1, help="draws junctions, cases and variants")
    parser.add_argument("--keep", action="store_true", help="leave what both sides wrote")
    return parser


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    # Both sides' commands and the checked-out tree go, also where a background job is ended.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    sys.exit(main(sys.argv[1:]))
