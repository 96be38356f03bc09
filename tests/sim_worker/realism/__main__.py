"""`python -m tests.sim_worker.realism [--fit CROSSING]`: how alike simulated and recorded cars are.

Reads the folder named by FORETWIN_DATA. Prints for each crossing and quantity the distance of
Wasserstein between the recorded and the simulated distribution, in the quantity's unit and in
standard deviations of the recorded one, then 5, 50 and 95 % of both. With `--fit` manners are
fitted there first, and printed; `--write` puts the distances where the program states them.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from foretwin.sim_worker.road_users.likeness import DriverLikeness
from foretwin.sim_worker.road_users.manners import SPREADS, Manners
from tests.sim_worker.realism.figures import QUANTITIES, Crossing, crossing, distances, samples
from tests.sim_worker.realism.fitting import fitted
from tests.sim_worker.realism.recordings import karlsruhe, mcity
from tests.world_gen.data_maps import data_folder

MCITY_MPS, KARLSRUHE_MPS = 25 * 0.44704, 50 / 3.6
"""Limits: 25 mph is that of Mcity's streets, 50 km/h stands in Karlsruhe's meta_data.csv."""


FITTED, LEAST_VALUES = "mcity", 50
"""Where the shipped manners were fitted; and fewer values than these are no distribution."""
TABLE = Path(__file__).parents[3] / "sim_worker" / "road_users" / "likeness.json"


def crossings(data: Path) -> tuple[Crossing, ...]:
    """Return both crossings."""
    return (
        crossing("mcity", mcity(data), limit_mps=MCITY_MPS),
        crossing("karlsruhe", karlsruhe(data), limit_mps=KARLSRUHE_MPS),
    )


def main(arguments: Sequence[str]) -> int:
    """Measure, and fit if asked to."""
    parser = argparse.ArgumentParser(prog="python -m tests.sim_worker.realism")
    parser.add_argument("--fit", choices=("mcity", "karlsruhe"))
    parser.add_argument("--tries", type=int, default=100)
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--write", action="store_true")
    asked = parser.parse_args(arguments)
    spreads, places = SPREADS, crossings(data_folder())
    if asked.fit:
        (place,) = (one for one in places if one.name == asked.fit)
        spreads = fitted(place, tries=asked.tries)
        for name, (median, spread) in zip(Manners._fields, spreads, strict=True):
            print(f"{name:14} {median:.3f}, {spread:.3f}")
    for place in places:
        made = samples(place, draws=asked.draws, spreads=spreads)
        for name, found in distances(place.recorded, made).items():
            real, drawn = (np.percentile(v[name], [5, 50, 95]) for v in (place.recorded, made))
            print(
                f"{place.name:10} {name:13} {found.of:6.3f} {QUANTITIES[name]:5} "
                f"{found.normalised:5.2f} sd of {found.recorded:5}; recorded "
                f"{real.round(2)}, simulated {drawn.round(2)}"
            )
    if asked.write:
        rows = likeness_rows(places)
        told = (json.dumps(msgspec.to_builtins(row), ensure_ascii=False) for row in rows)
        text = "[\n" + ",\n".join(told) + "\n]\n"
        TABLE.write_text(text, encoding="utf-8")
    return 0


def likeness_rows(places: Sequence[Crossing]) -> list[DriverLikeness]:
    """Return what the program states of its drivers, by one draw of each."""
    return [
        DriverLikeness(
            crossing=place.name,
            fitted=place.name == FITTED,
            quantity=name.replace("_", " "),
            unit=QUANTITIES[name],
            distance=round(found.of, 3),
            deviations=round(found.normalised, 3),
            recorded=found.recorded,
        )
        for place in places
        for name, found in distances(place.recorded, samples(place, draws=1)).items()
        if found.recorded >= LEAST_VALUES
    ]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
