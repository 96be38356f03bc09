"""How road users get on along their paths on their own: no faster than bends and brakes allow.

Speed squared is linear in the way between the nodes of a path, so that acceleration is steady
there, and where somebody is at a time is known in closed form: who plans an impact and who plays it
find the same places.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.contracts.scenario import Conduct
from foretwin.geometry.frenet_path import SPACING_M, FrenetPath
from foretwin.sim_worker import driver_model as driver

_BEYOND_M = 1000.0
"""So far before and behind a path's nodes speeds stay what they are at its ends."""
_LEAST_MPS = 0.1
"""Nobody who moves is slower."""
_APART_S = 1e5
"""More than anybody takes from the first node to the last."""


class WayMade(NamedTuple):
    """Where along their paths road users are, and how fast, both (…)."""

    arc_m: Array
    speed_mps: Array


def square_bound(path: FrenetPath, *, decel_mps2: float) -> Array:
    """Return (M,) the square of the speed at a path's nodes that the accelerations of an ordinary
    driver allow, across and along; in (m/s)². It is proportional to these accelerations."""
    return path.bounded_squares(
        lateral_accel_mps2=driver.LATERAL_ACCEL_MPS2,
        decel_mps2=decel_mps2,
        accel_mps2=driver.MAX_ACCEL_MPS2,
    )


def briskness(conduct: Conduct, decel_mps2: float) -> float:
    """Return by what the accelerations of a heedless driver exceed an ordinary one's.

    Who stops gently drives gently, so that no bend ever asks for more than its brakes give.
    """
    if conduct != "stops":
        return driver.HEEDLESS_BRISKNESS
    return min(max(decel_mps2 / driver.COMFORT_DECEL_MPS2, 0.5), driver.HEEDLESS_BRISKNESS)


class Paces:
    """K motions, each along one of P paths at its own speed, slower where bends ask for it.

    `path_of` (K,) are places in `paths`; `briskness` (K,) multiplies an ordinary driver's
    accelerations.
    """

    def __init__(
        self,
        paths: Sequence[FrenetPath],
        path_of: Indices,
        speed_mps: Array,
        briskness: Array,
    ) -> None:
        square = np.square(np.maximum(speed_mps, _LEAST_MPS))
        self._begin, self._last = np.zeros((2, len(path_of)), np.intp)
        self._first_arc, self._since = np.zeros((2, len(path_of)))
        arcs, speeds, times, searched = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
        begin = motions = 0
        for place in np.unique(path_of):
            rows, path = np.flatnonzero(path_of == place), paths[place]
            bound = square_bound(path, decel_mps2=driver.COMFORT_DECEL_MPS2)
            allowed = briskness[rows, None] * bound
            speed = np.sqrt(np.minimum(square[rows, None], allowed))
            speed = np.pad(speed, ((0, 0), (1, 1)), mode="edge")
            ends = path.arc_m[[0, -1]] + [-_BEYOND_M, _BEYOND_M]
            arc = np.concatenate([ends[:1], path.arc_m, ends[1:]])
            took = 2.0 * np.diff(arc) / (speed[:, 1:] + speed[:, :-1])
            time = np.pad(np.cumsum(took, axis=1), ((0, 0), (1, 0)))
            number = np.arange(len(rows))
            self._since[rows] = _APART_S * (motions + number)
            self._begin[rows], self._last[rows] = begin + len(arc) * number, len(arc) - 2
            self._first_arc[rows] = path.arc_m[0]
            arcs.append(np.tile(arc, len(rows)))
            speeds.append(speed.ravel())
            times.append(time.ravel())
            searched.append((time + self._since[rows, None]).ravel())
            begin += len(arc) * len(rows)
            motions += len(rows)
        self._arc, self._speed, self._time = map(np.concatenate, (arcs, speeds, times))
        self._searched = np.concatenate(searched)
        """Times of all motions, one after the other, so that one search finds any of them."""
        step = np.diff(self._arc, append=np.inf)
        self._accel = np.diff(np.square(self._speed), append=0.0) / (2.0 * step)

    def __len__(self) -> int:
        return len(self._begin)

    def time_at(self, motion: Indices | int, arc_m: Array) -> Array:
        """Return when (…) motions come by arc lengths (…), each on a clock of its own, in s."""
        place = np.floor((arc_m - self._first_arc[motion]) / SPACING_M).astype(np.intp) + 1
        node = self._begin[motion] + np.clip(place, 0, self._last[motion])
        on_m, speed = arc_m - self._arc[node], self._speed[node]
        there = np.sqrt(np.square(speed) + 2.0 * self._accel[node] * on_m)
        return np.asarray(self._time[node] + 2.0 * on_m / (speed + there))

    def at(self, motion: Indices | int, time_s: Array) -> WayMade:
        """Return where motions (…) are at times (…) of their own clocks."""
        found = np.searchsorted(self._searched, time_s + self._since[motion], side="right") - 1
        first = self._begin[motion]
        node = np.clip(found, first, first + self._last[motion])
        # The search rounds, the more the more motions there are; what is found must not.
        node = np.maximum(node - (time_s < self._time[node]), first)
        on_s, speed, accel = time_s - self._time[node], self._speed[node], self._accel[node]
        arc = self._arc[node] + on_s * (speed + 0.5 * accel * on_s)
        return WayMade(arc, speed + accel * on_s)

    def braked(
        self, motion: Indices | int, time_s: Array, brakes_at_s: Array, decel_mps2: Array | float
    ) -> WayMade:
        """Return where motions are at times, if they brake from `brakes_at_s` on until they stand;
        both on their own clocks."""
        free = self.at(motion, np.minimum(time_s, brakes_at_s))
        brakes_for = np.maximum(time_s - brakes_at_s, 0.0)
        with np.errstate(divide="ignore"):  # who brakes by nothing does so for good
            brakes_for = np.minimum(brakes_for, free.speed_mps / decel_mps2)
        speed = free.speed_mps - decel_mps2 * brakes_for
        return WayMade(free.arc_m + brakes_for * (free.speed_mps + speed) / 2.0, speed)
