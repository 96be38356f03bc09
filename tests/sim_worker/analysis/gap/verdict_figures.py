"""How soon the verdict falls: `python -m tests.sim_worker.analysis.gap.verdict_figures`.

`faults 1 6` judges 25 faults on the ways of seeds 1 to 5, `quiet 100 213` the hour without
faults, `real` every drive of the data folder (FORETWIN_DATA).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tests.sim_worker.analysis.gap.judging_faults import IN_TIME_S, Case, judged, verdicts_of
from tests.sim_worker.analysis.gap.real_drives import accused_in
from tests.sim_worker.faulty_standin import CAR_FAULTS, DURATION_S, MODEL_FAULTS
from tests.world_gen.data_maps import data_folder

FAULTS = (*CAR_FAULTS, *MODEL_FAULTS)


def print_faults(seeds: range) -> None:
    """Print a row for each fault: right, named and in time of how many, and after how long."""
    cases: list[Case] = []
    print(f"{'fault':<30} {'in':<6} right named in time  seconds with excitation")
    for fault in FAULTS:
        row = [judged(fault, seed=seed) for seed in seeds]
        cases += row
        where = "car" if fault in CAR_FAULTS else "model"
        took = " ".join(f"{case.excited_s:.1f}" for case in row)
        counts = [sum(case.right for case in row), sum(case.named for case in row)]
        counts.append(sum(case.in_time for case in row))
        said = " ".join(f"{count:>5}" for count in counts[:2]) + f" {counts[2]:>7}"
        print(f"{fault:<30} {where:<6} {said}  {took}", flush=True)
    right, named = sum(case.right for case in cases), sum(case.named for case in cases)
    in_time = sum(case.in_time for case in cases)
    slow = np.nanpercentile([case.excited_s for case in cases], [50, 95, 100])
    print(
        f"{len(cases)} cases: {right} right, {named} named, {in_time} right within "
        f"{IN_TIME_S:g} s ({in_time / len(cases):.1%}); median, 95th percentile, longest "
        f"{slow[0]:.1f}, {slow[1]:.1f}, {slow[2]:.1f} s"
    )


def print_quiet(seeds: range) -> None:
    """Print whoever is accused on ways without faults."""
    told = []
    for seed in seeds:
        said = verdicts_of(None, seed=seed, until_first=False)
        told += said
        accused = "; ".join(f"{one.culprit} {one.cause}: {one.text}" for one in said)
        print(f"seed {seed}: {accused or 'nobody'}", flush=True)
    hours = len(seeds) * DURATION_S / 3600.0
    print(f"{hours:.2f} h of stand-in driving without faults: {len(told)} false alarms")


def print_real(data: Path) -> None:
    """Print whoever is accused on recorded drives."""
    for drive, seconds, said in accused_in(data):
        names = ", ".join(f"{one.culprit} {one.cause}" for one in said) or "nobody"
        print(f"{drive:<62} {seconds:>6.0f} s: {names}", flush=True)


def main(words: list[str]) -> None:
    """Print what was asked for."""
    match words:
        case ["faults", first, end]:
            print_faults(range(int(first), int(end)))
        case ["quiet", first, end]:
            print_quiet(range(int(first), int(end)))
        case ["real"]:
            print_real(data_folder())
        case _:
            print(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
