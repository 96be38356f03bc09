"""What can be known of when a moving car will be somewhere, and what is told of it.

    python -m tests.trust.knowable [NAME ...] [--group given|tuned_on|held_out]

drives the passes and looks, once a second while the car moves, at two kinds of places ahead. Where
it really is 10 s later, without having stood: how far off the countdown's law is there, what
boosted trees make of all that is known at that instant, and what they make of it once an oracle
tells the least speed on the way. Trees learn from `given` and `tuned_on` and are asked on
`held_out` alone. And where the law has it in 10 and in 5 s: how often it comes between, before and
after what is told, after a stop too. Arrivals at junctions are few; places are some thousands.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from foretwin.contracts.arrays import Array
from tests.trust.nominal_passes import Group, Pass, asked_passes
from tests.trust.places_ahead import (
    TOLD_S,
    Came,
    Moment,
    Observed,
    Place,
    WayDriven,
    places,
    what_came,
)

ASKED_S = 10.0
"""Trees learn from places of all times, and are asked at this one."""
_LEARNING = {"max_iter": 150, "learning_rate": 0.05, "max_leaf_nodes": 15, "random_state": 0}


def told_row(name: str, found: list[Came]) -> str:
    """Return how often places were reached between, before and after, as a row of the table."""
    cells = [name]
    for in_s in TOLD_S:
        mine = [one for one in found if one.told.in_s == in_s]
        if not mine:
            cells.append("-")
            continue
        came = np.array([one.came_s for one in mine])
        early, late = np.array([(one.told.early_s, one.told.late_s) for one in mine]).T
        before, after = float(np.mean(came < early)), float(np.mean(came > late))
        long_s = (late - early)[np.isfinite(late)]
        cells.append(
            f"{100.0 * (1.0 - before - after):.0f} / {100.0 * before:.0f} / {100.0 * after:.0f} "
            f"({len(mine)}), {100.0 * np.mean(np.isinf(late)):.0f}, "
            f"{np.median(long_s) if len(long_s) else math.nan:.1f} s"
        )
    return "| " + " | ".join(cells) + " |"


def off_row(name: str, in_s: Array) -> str:
    """Return how far times for `ASKED_S` are off, as a row of the table."""
    off = in_s - ASKED_S
    median, most = np.percentile(np.abs(off), (50.0, 95.0))
    return f"| {name} | {len(off)} | {median:.2f} | {most:.2f} | {off.mean():+.2f} |"


def learnt_s(learnt: list[Place], asked: list[Place], *, oracle: bool) -> Array:
    """Return (N,) what trees make of places, by what is known of others, or an oracle tells."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    def features(some: list[Place]) -> Array:
        return np.array([one.known + [one.least_mps] * oracle for one in some])

    share = np.log([one.later_s / one.law_s for one in learnt])
    model = HistGradientBoostingRegressor(min_samples_leaf=min(200, len(learnt) // 20), **_LEARNING)
    # A time is off by as much as its place is, in parts of the speed there.
    weights = np.maximum([one.last_mps for one in learnt], 1.0)
    model.fit(features(learnt), share, sample_weight=weights)
    return np.array([one.law_s for one in asked]) * np.exp(model.predict(features(asked)))


def driven_in(on: Pass) -> tuple[list[Moment], WayDriven]:
    """Return a pass's moments and how it was driven, on the truth's clock."""
    assert isinstance(on.drive, Observed)
    track = on.truth.track
    base_s = track.stamp_ns[0] * 1e-9
    time_s = (track.stamp_ns - track.stamp_ns[0]) * 1e-9
    moments = [one._replace(time_s=one.time_s - base_s) for one in on.drive.moments]
    inside = [one for one in moments if on.from_s <= one.time_s < on.until_s]
    return inside, WayDriven(time_s, on.truth.way_m, track.speed_mps)


def main(arguments: list[str]) -> int:
    """Print both tables."""
    usual: tuple[Group, ...] = "given", "tuned_on", "held_out"
    driven_ones = asked_passes("tests.trust.knowable", arguments, usual=usual, driver=Observed)
    told: dict[str, list[Came]] = {}
    learnt: list[Place] = []
    asked: list[Place] = []
    for on in driven_ones:
        moments, driven = driven_in(on)
        came = told.setdefault(f"{on.name.split()[0]}, {on.group}", [])
        for moment in moments:
            came += what_came(moment, driven)
            found = places(moment, driven)
            learnt += found if on.group != "held_out" else []
            asked += [one for one in found if one.later_s == ASKED_S] * (on.group == "held_out")
    print("| drive | between / before / after %, endless %, median length: 10 s | 5 s |")
    print("|---|---|---|")
    for name, of_drive in told.items():
        print(told_row(name, of_drive))
    print(told_row("all", [one for of_drive in told.values() for one in of_drive]))
    if not learnt or not asked:
        return 0
    print("\n| 10 s before | places | median s | 95th percentile s | mean s |")
    print("|---|--:|--:|--:|--:|")
    print(off_row("the countdown's law", np.array([one.law_s for one in asked])))
    print(off_row("learnt from all that is known", learnt_s(learnt, asked, oracle=False)))
    print(off_row("and told the least speed", learnt_s(learnt, asked, oracle=True)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
