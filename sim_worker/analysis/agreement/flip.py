"""How large a gap between simulation and reality flips the answer: the measured gap, grown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.frames import wrap_angle
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths
from foretwin.sim_worker.analysis.agreement.criteria import CRITERIA, CriteriaEvaluator
from foretwin.sim_worker.analysis.agreement.window import Users

DIRECTIONS = ("along", "across", "both")
MOST_M = 10.0
"""A gap grown beyond this is no gap any more."""
_LEAST_M = 0.01
"""A smaller gap has no pattern that could be grown."""
_LEAST_WAY_M, _NEAR_M = 2.0, 40.0
_COARSE, _FINE = 40, 16


class Gap(NamedTuple):
    """Reality minus simulation at N instants, along and across the simulated way."""

    along_m: Array
    across_m: Array
    yaw_rad: Array
    speed_mps: Array

    def peak_m(self, direction: str) -> float:
        """Return the greatest distance of the gap in one of `DIRECTIONS`."""
        if direction == "both":
            return float(np.hypot(self.along_m, self.across_m).max())
        return float(np.abs(self.along_m if direction == "along" else self.across_m).max())


class Flip(NamedTuple):
    """The smallest growth that flips pass or fail, None where none up to `MOST_M` does, and the
    criteria that fail then."""

    direction: str
    factor: float | None
    gap_m: float | None
    fails: tuple[str, ...] = ()


def gap_between(simulated: Array, driven: Array) -> Gap:
    """Return the gap of driven states (N, 8) from simulated ones (N, 8).

    Along and across are measured on the simulated way, so that being late in a bend is a gap along
    it; a car that stands has but its axes.
    """
    yaw = np.unwrap(simulated[:, 2])
    arc = arc_lengths(simulated[:, :2])
    speed = driven[:, 3] - simulated[:, 3]
    if arc[-1] < _LEAST_WAY_M:
        dx, dy = driven[:, 0] - simulated[:, 0], driven[:, 1] - simulated[:, 1]
        cos, sin = np.cos(yaw), np.sin(yaw)
        turned = np.asarray(wrap_angle(driven[:, 2] - yaw))
        return Gap(cos * dx + sin * dy, cos * dy - sin * dx, turned, speed)
    way = FrenetPath(simulated[:, :2])
    place = way.locate(driven[:, :2], near_arc_m=arc, within_m=_NEAR_M)
    turned = np.asarray(wrap_angle(driven[:, 2] - np.interp(place.arc_m, arc, yaw)))
    return Gap(place.arc_m - arc, place.offset_m, turned, speed)


def grown(simulated: Array, gap: Gap, factors: Array, direction: str) -> Array:
    """Return states (K, N, 8) with the gap, `factors` (K,) times, laid upon a simulation (N, 8).

    What is along shifts the car on its own way, prolonged straight at both ends: a gap in time
    does not carry it off a bend.
    """
    factor = factors[:, None]
    found = np.repeat(simulated[None], len(factors), axis=0)
    if direction != "across":
        arc = arc_lengths(simulated[:, :2])
        yaw = np.unwrap(simulated[:, 2])
        far = 2.0 * MOST_M + float(np.abs(gap.along_m).max() * np.abs(factors).max(initial=0.0))
        ends = np.array([np.cos(yaw[[0, -1]]), np.sin(yaw[[0, -1]])]) * far
        at = arc + factor * gap.along_m
        known = np.concatenate([[-far], arc, [arc[-1] + far]])
        for column in (0, 1):
            values = simulated[:, column]
            first, last = values[0] - ends[column, 0], values[-1] + ends[column, 1]
            found[:, :, column] = np.interp(at, known, np.concatenate([[first], values, [last]]))
        found[:, :, 2] = np.interp(at, known, np.concatenate([[yaw[0]], yaw, [yaw[-1]]]))
        found[:, :, 3] += factor * gap.speed_mps
    if direction != "along":
        aside = factor * gap.across_m
        found[:, :, 0] -= np.sin(found[:, :, 2]) * aside
        found[:, :, 1] += np.cos(found[:, :, 2]) * aside
        found[:, :, 2] += factor * gap.yaw_rad
    return found


def flips(
    evaluator: CriteriaEvaluator,
    simulated: Array,
    users: Users,
    gap: Gap,
    asked: Flags,
    *,
    fails: bool,
) -> tuple[Flip, ...]:
    """Return for each of `DIRECTIONS` the smallest growth of the gap that flips the verdict: after
    which the simulation fails for sure, or, where it `fails`, no longer does.

    Two sweeps, each of all directions at once: evenly up to `MOST_M`, then between the last
    factor that does not flip and the first that does. The result is `MOST_M` / 640 fine.
    """
    there = [name for name in DIRECTIONS if gap.peak_m(name) >= _LEAST_M]
    low = dict.fromkeys(there, 0.0)
    high = {name: MOST_M / gap.peak_m(name) for name in there}
    flipped = dict.fromkeys(there, True)
    failed: dict[str, tuple[str, ...]] = {}
    for count in (_COARSE, _FINE):
        open_ = [name for name in there if flipped[name]]
        if not open_:
            break
        factors = {
            name: low[name] + (high[name] - low[name]) * np.arange(1, count + 1) / count
            for name in open_
        }
        states = np.concatenate([grown(simulated, gap, factors[name], name) for name in open_])
        failed_now = evaluator.judge(states, users).fails & asked
        found = failed_now.reshape(len(open_), count, -1)
        for name, mine in zip(open_, found, strict=True):
            other = mine.any(axis=1) != fails
            flipped[name] = bool(other.any())
            first = int(other.argmax())
            if flipped[name]:
                high[name] = float(factors[name][first])
                failed[name] = tuple(np.array(CRITERIA)[mine[first]].tolist())
                low[name] = high[name] - float(factors[name][0] - low[name])
    return tuple(
        Flip(name, high[name], high[name] * gap.peak_m(name), failed[name])
        if flipped.get(name, False)
        else Flip(name, None, None)
        for name in DIRECTIONS
    )
