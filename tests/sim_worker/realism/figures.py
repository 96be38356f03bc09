"""What is measured of cars, recorded or simulated, and how far apart two such distributions are."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import wasserstein_distance

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.road_users.manners import SPREADS, Spreads
from tests.sim_worker.realism.recordings import STEP_S, Recording, motion
from tests.sim_worker.realism.simulated import meeting, simulated
from tests.sim_worker.realism.windows import EDGE, Seen, Window, drivers, recorded, windows

QUANTITIES = {
    "speed": "m/s",
    "acceleration": "m/s²",
    "deceleration": "m/s²",
    "lateral": "m/s²",
    "gap": "m",
    "headway": "s",
    "gap_accepted": "s",
}
_MOVES_MPS, _FOLLOWS_MPS, _FOLLOWS_M, _FOLLOWS_S = 1.0, 2.0, 50.0, 6.0
_BESIDE_M, _ALIKE_COS = 1.8, 0.8
_ACCEPTED_S = 8.0
_BRAKES_MPS2 = 0.2

Samples = dict[str, Array]


class Distance(NamedTuple):
    """Between two distributions: Wasserstein's in the quantity's unit, and in standard deviations
    of the recorded one; and how many values were recorded."""

    of: float
    normalised: float
    recorded: int


FOLLOWING = ("gap", "headway")


def collect(window: Window, seen: Seen, replayed: Sequence[int] = ()) -> Samples:
    """Return the values of each quantity of cars of a window, while they were recorded, but of
    those `replayed`."""
    found: dict[str, list[Array]] = {name: [] for name in QUANTITIES}
    for r, (car, steps) in enumerate(zip(window.cars, window.steps, strict=True)):
        if r in replayed:
            continue
        at = window.begin - car.track.first
        mine = seen.xy_m[r]
        later = mine[: steps + EDGE]
        whole = np.concatenate([car.track.xy_m[at - EDGE : at], later])
        moved = motion(whole)
        cut = slice(EDGE, EDGE + steps)
        speed, along, across = (column[cut] for column in moved)
        moves = speed > _MOVES_MPS
        found["speed"].append(speed[moves])
        found["acceleration"].append(along[moves & (along > 0.0)])
        found["deceleration"].append(-along[moves & (along < -_BRAKES_MPS2)])
        found["lateral"].append(np.abs(across[speed > _FOLLOWS_MPS]))
        gap = _gaps(window, seen, r)[:steps]
        follows = (gap < _FOLLOWS_M) & (speed > _FOLLOWS_MPS)
        found["gap"].append(gap[follows])
        headway = gap[follows] / speed[follows]
        found["headway"].append(headway[headway < _FOLLOWS_S])
    found["gap_accepted"].append(_accepted(window, seen))
    return {name: np.concatenate([*values, np.zeros(0)]) for name, values in found.items()}


def _gaps(window: Window, seen: Seen, r: int) -> Array:
    """Return (N,) from bumper to bumper to the next one ahead on the line of car `r`."""
    car, arc = window.cars[r], seen.arc_m[r]
    gap = np.full(len(arc), np.inf)
    for o, other in enumerate(window.cars):
        if o == r:
            continue
        there = np.isfinite(seen.xy_m[o, :, 0]) & np.isfinite(arc)
        if not there.any():
            continue
        place = car.path.locate(seen.xy_m[o, there])
        yaw = other.path.pose_at(seen.arc_m[o, there]).yaw_rad
        turned = np.cos(yaw - car.path.pose_at(place.arc_m).yaw_rad)
        free = place.arc_m - arc[there] - (car.track.size_m[0] + other.track.size_m[0]) / 2.0
        ahead = (place.arc_m > arc[there]) & (np.abs(place.offset_m) < _BESIDE_M)
        ahead &= turned > _ALIKE_COS
        gap[there] = np.minimum(gap[there], np.where(ahead, free, np.inf))
    return gap


def _accepted(window: Window, seen: Seen) -> Array:
    """Return the times from one car's leaving of where two lines cross to the other's arriving."""
    found = []
    for p, one in enumerate(window.cars):
        for q in range(p):
            met = meeting(one, window.cars[q])
            if met is None:
                continue
            times = []
            for place, arc in ((p, met[0]), (q, met[1])):
                half = window.cars[place].track.size_m[0] / 2.0
                track = seen.arc_m[place, : window.steps[place]]
                if track[0] > arc - half or not (track > arc + half).any():
                    break
                reach, leave = (int(np.argmax(track > arc + side)) for side in (-half, half))
                times.append((reach * STEP_S, leave * STEP_S))
            if len(times) == 2:
                first, second = sorted(times)
                if 0.0 <= second[0] - first[1] <= _ACCEPTED_S:
                    found.append(second[0] - first[1])
    return np.array(found)


class Crossing(NamedTuple):
    """A place of recordings, ready to be simulated: its windows, its limit, and what was recorded
    there."""

    name: str
    limit_mps: float
    windows: tuple[Window, ...]
    recorded: Samples


def crossing(name: str, recordings: tuple[Recording, ...], *, limit_mps: float) -> Crossing:
    """Return a crossing by its recordings."""
    found = tuple(w for recording in recordings for w in windows(drivers(recording)))
    every = _joined(collect(w, recorded(w)) for w in found)
    behind = _joined(collect(w, recorded(w), heads(w)) for w in found)
    kept = {name: (behind if name in FOLLOWING else every)[name] for name in QUANTITIES}
    return Crossing(name, limit_mps, found, kept)


def samples(crossing: Crossing, *, draws: int, spreads: Spreads = SPREADS) -> Samples:
    """Return what is simulated of each quantity from the beginnings of all windows."""

    def played(replays: bool) -> Samples:
        found = []
        for window in crossing.windows:
            rows = heads(window) if replays else ()
            if replays and len(rows) == len(window.cars):
                continue
            steps = max(window.steps) + EDGE
            found += [
                collect(window, seen, rows)
                for seen in simulated(
                    window,
                    limit_mps=crossing.limit_mps,
                    draws=draws,
                    steps=steps,
                    spreads=spreads,
                    replayed=rows,
                )
            ]
        return _joined(found)

    free, behind = played(False), played(True)
    return {name: (behind if name in FOLLOWING else free)[name] for name in QUANTITIES}


@functools.cache
def heads(window: Window) -> tuple[int, ...]:
    """Return the cars with nobody ahead of them as a window begins.

    What they do next is not of anybody's following, and mostly for something that no recording
    tells. So whoever follows them is judged behind what they really did (as Kesting and Treiber
    2008, Calibrating car-following models by using trajectory data, do).
    """
    seen = recorded(window)
    return tuple(r for r in range(len(window.cars)) if not _gaps(window, seen, r)[0] < _FOLLOWS_M)


def _joined(found: Iterable[Samples]) -> Samples:
    every = list(found)
    none = [np.zeros(0)]
    return {name: np.concatenate([*(one[name] for one in every), *none]) for name in QUANTITIES}


def distances(real: Samples, made: Samples) -> dict[str, Distance]:
    """Return how far simulated values lie from recorded ones, by quantity."""
    found = {}
    for name in QUANTITIES:
        if len(real[name]) and len(made[name]):
            apart = float(wasserstein_distance(real[name], made[name]))
            found[name] = Distance(apart, apart / float(real[name].std()), len(real[name]))
    return found
