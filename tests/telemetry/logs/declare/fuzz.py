"""How often `declare` is right, says that it does not know, and is wrong: real drives, many seeds.

    python -m tests.telemetry.logs.declare.fuzz [--seeds 0:10] [--only dresden]

Drives are those of FORETWIN_DATA, and of FORETWIN_DRIVES where it names a folder. Prints what is
wrong, then a table, and whether planted latenesses were found: exit code 3 where anything is wrong.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from foretwin.telemetry.logs import open_log
from foretwin.world_gen.countries.outlines import place_at
from tests.telemetry.logs.declare.disguised import Drive, Table, disguise, drive_of, with_sensors
from tests.telemetry.logs.declare.judged import Judged, judged

DECLARATIONS = Path(__file__).parents[3] / "data" / "declarations"
_GIVEN = (
    ("comma", "drive-comma2k19-sf/segment40", None, False),
    ("dresden", "drive-dresden-imu/2014-03-26-000-Data.csv", "dresden.csv.toml", False),
    ("boreas", "drive-boreas-toronto/*.csv", "boreas.csv.toml", False),
    ("gendarmenmarkt", "drive-berlin-gendarmenmarkt/*_GT.txt", None, True),
    ("potsdamer", "drive-berlin-potsdamer-platz/*_GT.txt", None, True),
    ("westend", "drive-frankfurt-westend/*_GT.txt", None, True),
)
_FURTHER = (
    ("austin", "austin-bmw/austin_car_gps.csv", None, False),
    ("boulder", "boulder-rtk/boulder_no_std.csv", None, False),
    ("kitti", "kitti-05/kitti05.csv", None, True),
)
"""Name, file, its declaration, and whether its positions are given a car's sensors."""


def drives() -> Iterator[tuple[str, Drive]]:
    """Yield the drives that are there."""
    for variable, rows in (("FORETWIN_DATA", _GIVEN), ("FORETWIN_DRIVES", _FURTHER)):
        folder = os.environ.get(variable)
        for name, pattern, declaration, bare in rows if folder else ():
            file = next(Path(folder or ".").glob(pattern), None)
            if file is not None:
                declared = None if declaration is None else DECLARATIONS / declaration
                drive = drive_of(open_log(file, declaration=declared))
                yield name, with_sensors(drive, seed=len(name)) if bare else drive


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="0:5")
    parser.add_argument("--only", nargs="*")
    given = parser.parse_args()
    first, last = map(int, given.seeds.split(":"))
    tally: dict[str, Counter[str]] = {}
    asked: Counter[int] = Counter()
    late: list[tuple[str, float]] = []
    refused, longest_s, tables = 0, 0.0, 0
    for name, drive in drives():
        if given.only and name not in given.only:
            continue
        for seed in range(first, last):
            with tempfile.TemporaryDirectory() as folder:
                table = disguise(drive, Path(folder), seed=seed)
                began = time.process_time()
                found = judged(table, country_of=lambda lat, lon: place_at(lat, lon).code)
                longest_s = max(longest_s, time.process_time() - began)
                late += _found_late(drive, table, found, Path(folder), seed)
            tables += 1
            asked[found.asked] += 1
            refused += bool(found.refused)
            for key, verdict in found.verdicts.items():
                tally.setdefault(key, Counter())[verdict] += 1
            if found.why or found.refused:
                print(f"{name} {seed}: {found.why} {found.refused}\n    {table.made}", flush=True)
    return _told(tally, asked, late, refused, longest_s, tables)


def _found_late(
    drive: Drive, table: Table, found: Judged, folder: Path, seed: int
) -> list[tuple[str, float]]:
    """Return by how much each planted lateness was missed, against the same table without it."""
    planted = {name: late for name, late in table.late_s.items() if late and name in found.late_s}
    if not planted or seed % 3:
        return []
    plain = judged(disguise(drive, folder, seed=seed, late=False),
                   country_of=lambda lat, lon: place_at(lat, lon).code)  # fmt: skip
    return [
        (name, found.late_s[name] - plain.late_s[name] - late)
        for name, late in planted.items()
        if name in plain.late_s
    ]


def _told(
    tally: dict[str, Counter[str]], asked: Counter[int], late: list[tuple[str, float]],
    refused: int, longest_s: float, tables: int,
) -> int:  # fmt: skip
    whole: Counter[str] = Counter()
    print(f"{'field':18}{'right':>8}{'unknown':>9}{'wrong':>7}")
    for key, counts in sorted(tally.items()):
        whole += counts
        print(f"{key:18}{counts['right']:8}{counts['unknown']:9}{counts['wrong']:7}")
    total = max(sum(whole.values()), 1)
    verdicts = ("right", "unknown", "wrong")
    shares = ", ".join(f"{verdict} {whole[verdict] / total:.1%}" for verdict in verdicts)
    print(f"{tables} tables, {refused} refused, questions {dict(sorted(asked.items()))}: {shares}")
    for name in ("speed", "steering"):
        off = np.abs([missed for channel, missed in late if channel == name])
        if len(off):
            usual_s, most_s = float(np.median(off)), float(off.max())
            print(
                f"lateness of {name}: off by {usual_s:.3f} s, at most {most_s:.3f}, of {len(off)}"
            )
    print(f"longest {longest_s:.1f} s of CPU")
    return 3 if whole["wrong"] or max(asked, default=0) > 1 else 0


if __name__ == "__main__":
    sys.exit(main())
