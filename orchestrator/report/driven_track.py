"""Where a car was in a drive, as its state was estimated then, from the run's own recording."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.drive import VehicleState


class CarTrack(NamedTuple):
    """Where the car was: stamps (N,) rising, degrees (N, 2), speed (N,), and drive time (N,)."""

    stamp_ns: Stamps
    lat_lon_deg: Array
    speed_mps: Array
    time_s: Array

    def between(self, from_s: float, to_s: float) -> CarTrack:
        """Return the part of a track between two drive times."""
        some = slice(
            bisect.bisect_left(self.time_s, from_s), bisect.bisect_right(self.time_s, to_s)
        )
        return CarTrack(
            self.stamp_ns[some], self.lat_lon_deg[some], self.speed_mps[some], self.time_s[some]
        )


def driven_track(states: Sequence[VehicleState], *, start_stamp_ns: int) -> CarTrack | None:
    """Return the track of recorded states; None where there are none.

    Drive time begins at `start_stamp_ns`.
    """
    if len(states) < 2:
        return None
    stamps = np.array([state.stamp_ns for state in states], dtype=np.int64)
    order = np.argsort(stamps, kind="stable")
    return CarTrack(
        stamps[order],
        np.array([(s.position.lat_deg, s.position.lon_deg) for s in states])[order],
        np.array([s.speed_mps for s in states])[order],
        (stamps[order] - start_stamp_ns) / 1e9,
    )
