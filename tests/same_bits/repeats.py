"""`python -m tests.same_bits.repeats FOLDER...` repeats futures drawn from runs and sweeps.

Each by the command `foretwin repeat --json`. Exit code 0 where every one came to the same bits, 3
where one did not or could not be played.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from foretwin.recordings import open_run, open_sweep

DIFFERENT = 3


def main(arguments: Sequence[str]) -> int:
    """Draw the same number from each folder, repeat them, print each that differs and the count."""
    parser = argparse.ArgumentParser(prog="python -m tests.same_bits.repeats", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--draws", type=int, default=100, help="futures in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--among", action="store_true", help="only those among other road users")
    parser.add_argument("--at-once", type=int, default=2, help="processes")
    asked = parser.parse_args(arguments)
    share, more = divmod(asked.draws, len(asked.folders))
    drawn = [
        (folder, future_id)
        for number, folder in enumerate(asked.folders)
        for future_id in draw(folder, share + (number < more), asked.seed, among=asked.among)
    ]
    with ThreadPoolExecutor(asked.at_once) as pool:
        equal = list(pool.map(repeats, drawn))
    print(f"{sum(equal)} of {len(drawn)} the same, of {len(asked.folders)} folders")
    return 0 if drawn and all(equal) else DIFFERENT


def draw(folder: Path, count: int, seed: int, *, among: bool = False) -> list[str]:
    """Draw futures that were played, out of all rounds or jobs of a folder; with `among` of those
    that tell how near others came."""
    opened = open_sweep(folder) if (folder / "sweep.json").is_file() else open_run(folder)
    table = opened.table("futures")
    ids = table.column("future_id").to_pylist()
    told = table.column("min_clearance_m" if among else "trajectory_sha256").to_pylist()
    played = sorted(one for one, said in zip(ids, told, strict=True) if said is not None)
    return random.Random(seed).sample(played, min(count, len(played)))


def repeats(one: tuple[Path, str]) -> bool:
    """Repeat one future; prints what was answered where it is not equal."""
    folder, future_id = one
    command = [sys.executable, "-P", "-m", "foretwin", "repeat", str(folder), future_id, "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode == 0 and json.loads(ended.stdout)["equal"]:
        return True
    print(f"{folder} {future_id}: exit {ended.returncode}: {ended.stdout}{ended.stderr}".rstrip())
    return False


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
