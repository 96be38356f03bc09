"""`python -m tests.orchestrator.drive.sloped_figures`: what slopes do to identified gains.

Of the drawn town's route of two minutes, over a hillside of up to 9 %, as parts of the gains that
the same car's drive through a level town tells.
"""

from __future__ import annotations

import numpy as np

from foretwin.contracts.arrays import Array
from tests.orchestrator.drive.test_sloped_town import (
    driven,
    flat,
    gains,
    identified,
    real,
    seen,
    slopes,
    without_altitude,
)

SEEDS = 12


def main() -> None:
    level = gains(identified(driven(climbs=False), slopes(flat())))
    hills = driven(climbs=True)
    blind = without_altitude(hills)

    def show(name: str, found: Array) -> None:
        off = found / level - 1.0
        print(f"{name:32} drive {off[0]:+.1%}, brake {off[1]:+.1%}")

    show("altitude measured", gains(identified(hills, slopes(seen()))))
    show("the true slope", gains(identified(blind, slopes(real()))))
    show("believed level", gains(identified(blind, slopes(flat()))))
    told = [gains(identified(blind, slopes(seen(seed)))) / level - 1.0 for seed in range(SEEDS)]
    rms = np.sqrt(np.mean(np.square(told), axis=0))
    print(f"{'a map of SRTM, rms of ' + str(SEEDS):32} drive {rms[0]:.1%}, brake {rms[1]:.1%}")


if __name__ == "__main__":
    main()
