"""How well the countdown to the next junction counts down.

    python -m tests.trust.arrivals [NAME ...] [--group given|tuned_on|held_out]

prints for each pass, of arrivals before which the car did not stand, how far what is shown 10 and
5 s before was off (median, 95th percentile, mean in seconds), and how far the countdown departs
from counting down within 0.2 s (95th percentile). The last row has all of them. What can be known
of places ahead, and between when and when they are said to be reached, is in `knowable.py`.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.sim_worker.driver_model import STANDING_MPS
from tests.orchestrator.in_process_drive import LockStep
from tests.trust.nominal_passes import asked_passes

BEFORE_S = (10.0, 5.0)
_WITHIN_S = 0.25
_LAST_M = 3.0


class Shown(NamedTuple):
    """What a drive showed at a state: seconds until the next junction, and how far that is."""

    time_s: float
    speed_mps: float
    junction_id: str
    distance_m: float
    in_s: float | None


class Watched(LockStep):
    """A drive that notes its countdown."""

    def _take(self, state: VehicleState | None) -> None:
        if not hasattr(self, "shown"):
            self.shown: list[Shown] = []
        super()._take(state)
        way = self.mission.way
        if state is None or self.mission.state != "following" or not way.junctions:
            return
        first, time_s = way.junctions[0], state.stamp_ns * 1e-9
        name = first.junction.summary.id
        self.shown.append(Shown(time_s, state.speed_mps, name, first.distance_m, way.countdown_s))


def arrivals(shown: list[Shown]) -> Iterator[list[Shown]]:
    """Return what was shown before each junction that was reached."""
    for _, group in itertools.groupby(shown, lambda one: one.junction_id):
        one = list(group)
        if one[-1].distance_m < _LAST_M and len(one) > 1:
            yield one


def off_s(one: list[Shown], before_s: float) -> float | None:
    """Return how far the countdown was off so long before an arrival, None where the car stood."""
    last = one[-1]
    reached_s = last.time_s + last.distance_m / max(last.speed_mps, STANDING_MPS)
    left = [(reached_s - at.time_s, at) for at in one]
    rest = [at for left_s, at in left if left_s <= before_s + _WITHIN_S]
    nearest_s, at = min(left, key=lambda pair: abs(pair[0] - before_s))
    moving = all(at.speed_mps >= STANDING_MPS for at in rest)
    if abs(nearest_s - before_s) > _WITHIN_S or not moving or at.in_s is None:
        return None
    return at.in_s - nearest_s


def departures_s(one: list[Shown]) -> list[float]:
    """Return by how much the countdown does not count down, per 0.2 s, while the car moves."""
    return [
        0.2 * abs((b.in_s - a.in_s) / (b.time_s - a.time_s) + 1.0)
        for a, b in itertools.pairwise(one)
        if a.in_s is not None and b.in_s is not None and b.time_s > a.time_s
    ]


def row(name: str, groups: list[list[Shown]]) -> str:
    """Return a pass's figures as a row of the table."""
    cells = [name, str(len(groups))]
    for before_s in BEFORE_S:
        off = np.array([e for one in groups if (e := off_s(one, before_s)) is not None])
        if len(off):
            median, high = np.percentile(np.abs(off), (50.0, 95.0))
            cells.append(f"{median:.1f} / {high:.1f} / {off.mean():+.1f} ({len(off)})")
        else:
            cells.append("-")
    steps = [step for one in groups for step in departures_s(one)]
    cells.append(f"{np.percentile(steps, 95.0):.2f}" if steps else "-")
    return "| " + " | ".join(cells) + " |"


def main(arguments: list[str]) -> int:
    """Print the table."""
    asked = asked_passes("tests.trust.arrivals", arguments, driver=Watched)
    print("| drive | arrivals | 10 s before | 5 s before | departs s |")
    print("|" + " --- |" * 5)
    found: dict[str, list[list[Shown]]] = {}
    for on in asked:
        assert isinstance(on.drive, Watched)
        base = on.truth.track.stamp_ns[0] * 1e-9
        inside = [at for at in on.drive.shown if on.from_s <= at.time_s - base < on.until_s]
        found.setdefault(on.name.split()[0], []).extend(arrivals(inside))
    for name, of_drive in found.items():
        print(row(name, of_drive))
    if len(found) > 1:
        print(row("all", [one for of_drive in found.values() for one in of_drive]))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
