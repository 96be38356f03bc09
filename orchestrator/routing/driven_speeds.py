"""How fast the road ahead was driven before: the speeds of earlier drives in the store of tracks.

It is used where the user asks for tracks, and never otherwise. A track of this very drive, which a
replay finds in the store, would see the future: one that is where the car is, at the car's own
time, is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.frames import LocalFrame, local_from_geo
from foretwin.contracts.tracks import DrivenTrack

BESIDE_M = 5.0
"""A place that was driven farther off is another road's, or another lane's."""
ALONG_COS = 0.7
"""One that was driven in another direction is none of this way's."""
MOVING_MPS = 1.0
"""Slower places are waits, which the next drive does not have there."""
_MOST_PLACES = 48
"""About ten places lie so near on each pass."""
_SAME_DRIVE_M = 50.0


class _Pass(NamedTuple):
    """A track's places (N, 2) in the graph's frame, and its clock there."""

    stamp_ns: Stamps
    xy_m: Array


class DrivenSpeeds:
    """The speeds of earlier drives by place."""

    def __init__(self, tracks: Sequence[DrivenTrack], frame: LocalFrame) -> None:
        self._passes = [
            _Pass(track.stamp_ns, local_from_geo(frame, track.lat_deg, track.lon_deg))
            for track in tracks
        ]
        self._track = np.repeat(np.arange(len(tracks)), [len(one.xy_m) for one in self._passes])
        xy = np.concatenate([one.xy_m for one in self._passes])
        way = np.concatenate([np.gradient(one.xy_m, axis=0) for one in self._passes])
        self._way = way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        self._speed_mps = np.concatenate([track.speed_mps for track in tracks])
        self._tree = cKDTree(xy)

    def along(self, xy_m: Array, *, stamp_ns: int, car_xy_m: Array) -> Array:
        """Return the median speed (N,) driven beside each point (N, 2) of a path, in its direction.

        NaN where nobody drove. `stamp_ns` is the car's clock where it is at `car_xy_m`.
        """
        away, near = self._tree.query(xy_m, k=_MOST_PLACES, distance_upper_bound=BESIDE_M)
        known = np.isfinite(away)
        near = np.where(known, near, 0)
        way = np.gradient(xy_m, axis=0)
        way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        known &= (self._way[near] * way[:, None]).sum(axis=2) > ALONG_COS
        known &= self._speed_mps[near] > MOVING_MPS
        known &= ~self._is_this_drive(stamp_ns, car_xy_m)[self._track[near]]
        speed = np.sort(np.where(known, self._speed_mps[near], np.inf), axis=1)
        count = known.sum(axis=1)
        middle = speed[np.arange(len(speed)), np.maximum(count - 1, 0) // 2]
        return np.where(count > 0, middle, np.nan)

    def _is_this_drive(self, stamp_ns: int, car_xy_m: Array) -> np.ndarray:
        found = np.zeros(len(self._passes), dtype=bool)
        for number, one in enumerate(self._passes):
            since = (one.stamp_ns - stamp_ns) * 1e-9
            if since[0] <= 1.0 and since[-1] >= -1.0:
                there = [np.interp(0.0, since, one.xy_m[:, k]) for k in (0, 1)]
                found[number] = np.hypot(*(there - car_xy_m)) < _SAME_DRIVE_M
        return found
