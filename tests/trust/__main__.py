"""How far the estimator's states can be trusted, over real drives.

    python -m tests.trust [NAME ...] [--split tuning|held_out]

prints a row for each drive in FORETWIN_DATA and FORETWIN_DRIVES (see `drives.py`).
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from tests.trust.consistency import Consistency, consistency_of
from tests.trust.drives import all_drives
from tests.trust.states import states_of
from tests.trust.truth import truth_of

_HEAD = (
    "| drive | s | false standstills | yaw > 20° | speed RMS m/s | position RMS / p95 m "
    "| yaw p95 ° | within 95 %: position, yaw, speed | µs/sample |"
)


def row(name: str, found: Consistency) -> str:
    """Return a drive's figures as a row of the table.

    Beside lost headings stands in brackets how often the reference itself was no car's motion.
    """
    shares = ", ".join(
        "-" if np.isnan(share) else f"{100.0 * share:.0f}"
        for share in (found.position_within, found.yaw_within, found.speed_within)
    )
    torn = f" (+{len(found.torn_s)})" if found.torn_s else ""
    return (
        f"| {name} | {found.seconds:.0f} | {len(found.false_standstills_s)} "
        f"| {len(found.yaw_losses_s)}{torn} | {found.speed_rms_mps:.3f} "
        f"| {found.position_rms_m:.3f} / {found.position_p95_m:.3f} | {found.yaw_p95_deg:.2f} "
        f"| {shares} | {found.us_per_sample:.0f} |"
    )


def main(arguments: list[str]) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.trust")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--split", choices=("tuning", "held_out"), default=None)
    given = parser.parse_args(arguments)
    drives = [d for d in all_drives(given.split) if not given.names or d.name in given.names]
    print(_HEAD)
    print("|" + " --- |" * 9)
    for drive in drives:
        truth = truth_of(drive)
        print(row(drive.name, consistency_of(states_of(drive.log(), truth.frame), truth)))
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
