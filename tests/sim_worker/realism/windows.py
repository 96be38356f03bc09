"""Futures of recorded cars, as a drive foresees those that it sees, from each second on.

Each car drives on along the line that it drove, with whatever makes it wait from outside, such as a
light, as it was: who stood without anybody ahead finds a red line there until it set off.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.driver_model import OTHERS_REACTION_S
from foretwin.sim_worker.road_users.crowd import EgoBoxes
from tests.sim_worker.realism.recordings import STEP_S, Motion, Recording, Track, motion

HORIZON_S, EVERY_S = 6.0, 1.0
_STANDS_MPS = 0.3
_NODE_M = 0.5
EDGE = 7
"""Steps at either end of a track, at which a fitted parabola says little."""
_NO_LEADER_M = 9.0
NOBODY = EgoBoxes(np.full((1, 3), 9e3), np.zeros(1), 0, np.array([-9e3]), 4.5, 1.8)


@dataclass(frozen=True, eq=False)
class Driver:
    """A car of a recording with the line that it drove, and its motion and place on it (N,)."""

    track: Track
    path: FrenetPath
    arc_m: Array
    motion: Motion
    waits_at_m: float
    """Arc length of its front where it stands for no leader; infinite where it does not."""
    waits_until: int
    """The step of the recording at which it sets off."""


def drivers(recording: Recording) -> tuple[Driver, ...]:
    """Return the cars of a recording that move."""
    found = []
    for track in recording.tracks:
        steps = np.hypot(*np.diff(track.xy_m, axis=0).T)
        if steps.sum() < 8.0 or np.hypot(*(track.xy_m[-1] - track.xy_m[0])) < 5.0:
            continue
        kept = [track.xy_m[0]]
        for place in track.xy_m:
            if np.hypot(*(place - kept[-1])) > _NODE_M:
                kept.append(place)
        path = FrenetPath(np.array(kept)).eased
        arc = np.maximum.accumulate(path.locate(track.xy_m).arc_m)
        found.append(Driver(track, path, arc, motion(track.xy_m), np.inf, -1))
    return tuple(_with_line(one, found) for one in found)


def _with_line(one: Driver, others: Sequence[Driver]) -> Driver:
    """Return a driver with where it waited for nobody ahead of it, the first time."""
    stands = np.flatnonzero(one.motion.speed_mps < _STANDS_MPS)
    if not len(stands):
        return one
    at = int(stands[0])
    here = one.track.xy_m[at]
    arc = float(one.arc_m[at])
    for other in others:
        step = one.track.first + at - other.track.first
        if other is one or not 0 <= step < len(other.arc_m):
            continue
        place = one.path.locate(other.track.xy_m[step][None])
        ahead = float(place.arc_m[0]) - arc
        if 1.0 < ahead < _NO_LEADER_M and abs(float(place.offset_m[0])) < 2.0:
            return one
    moves = np.flatnonzero(np.hypot(*(one.track.xy_m - here).T) > 1.0)
    later = moves[moves > at]
    # The light has changed so long before anybody is seen to move as it takes to react.
    went = stands[stands < later[0]][-1] - round(OTHERS_REACTION_S[0] / STEP_S) if len(later) else 0
    until = one.track.first + (max(int(went), at) if len(later) else len(one.arc_m))
    front = arc + one.track.size_m[0] / 2.0
    return replace(one, waits_at_m=front + 1.0, waits_until=until)


class Window(NamedTuple):
    """Who begins at step `begin` of a recording, and for how many steps (R,) it was there."""

    begin: int
    cars: tuple[Driver, ...]
    steps: tuple[int, ...]


def windows(cars: Sequence[Driver]) -> Iterator[Window]:
    """Yield the beginnings of futures, each with all who are there for a second on."""
    last = max((car.track.first + len(car.arc_m) for car in cars), default=0)
    for begin in range(0, last, round(EVERY_S / STEP_S)):
        there = []
        for car in cars:
            at = begin - car.track.first
            left = len(car.arc_m) - EDGE - at
            if at >= EDGE and left >= 1.0 / STEP_S:
                there.append((car, min(left, round(HORIZON_S / STEP_S) + 1)))
        if there:
            yield Window(begin, *map(tuple, zip(*there, strict=True)))


class Seen(NamedTuple):
    """Positions (R, N, 2) every `STEP_S`, NaN once a car was gone, and arc lengths (R, N)."""

    xy_m: Array
    arc_m: Array


def recorded(window: Window) -> Seen:
    """Return what the cars of a window did."""
    count = max(window.steps) + EDGE
    xy, arc = (
        np.full((len(window.cars), count, 2), np.nan),
        np.full((len(window.cars), count), np.nan),
    )
    for r, (car, steps) in enumerate(zip(window.cars, window.steps, strict=True)):
        at = window.begin - car.track.first
        # Beyond the end of what counts, for the parabolas.
        there = slice(at, at + steps + EDGE)
        xy[r, : steps + EDGE], arc[r, : steps + EDGE] = car.track.xy_m[there], car.arc_m[there]
    return Seen(xy, arc)
