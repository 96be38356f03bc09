"""Tracks of a car's earlier drives, as the user keeps them."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Stamps
from foretwin.contracts.errors import UserError

MOST_POINTS = 2_000_000
"""A car's year of a point each metre is less in one piece."""


class DrivenTrack(msgspec.Struct, frozen=True, kw_only=True):
    """Where a car drove, in driving order, as it was estimated: base_link, about every metre.

    `id` names its content; `name` says where it came from. `stamp_ns` (N,) is the vehicle's clock,
    `speed_mps` (N,) what it drove. Fields that a later foretwin adds are passed over by this one.
    """

    id: str
    name: str
    added_utc: str
    """When it was put into the store, ISO 8601."""
    stamp_ns: Stamps
    lat_deg: Array
    lon_deg: Array
    speed_mps: Array
    position_std_m: float = 0.0
    """Standard deviation of its places, in each direction, as far as it is known."""

    def validate(self) -> DrivenTrack:
        """Return self; raises UserError where columns do not fit each other or Earth."""
        columns = (self.stamp_ns, self.lat_deg, self.lon_deg, self.speed_mps)
        shape = (len(self.lat_deg),)
        if any(column.shape != shape for column in columns) or not 2 <= shape[0] <= MOST_POINTS:
            raise UserError(
                f"track {self.id}: columns of {[len(c) for c in columns]} points; "
                f"2 to {MOST_POINTS} of each are right"
            )
        if not all(np.isfinite(column).all() for column in columns):
            raise UserError(f"track {self.id}: holds values that are not finite")
        if not 0.0 <= self.position_std_m < np.inf:
            raise UserError(f"track {self.id}: a standard deviation of {self.position_std_m} m")
        if np.abs(self.lat_deg).max() > 90.0 or np.abs(self.lon_deg).max() > 180.0:
            raise UserError(f"track {self.id}: lies outside latitude ±90, longitude ±180")
        return self


class TrackSet(NamedTuple):
    """The tracks that correct a map's lanes, and a key for what is built with them."""

    tracks: tuple[DrivenTrack, ...]
    key: str

    @staticmethod
    def of(tracks: tuple[DrivenTrack, ...]) -> TrackSet:
        """Return the tracks in the order of their ids, which does not depend on who listed them."""
        ordered = tuple(sorted(tracks, key=lambda track: track.id))
        names = " ".join(track.id for track in ordered)
        return TrackSet(ordered, hashlib.sha256(names.encode()).hexdigest()[:16])


def track_id(lat_deg: Array, lon_deg: Array, stamp_ns: Stamps) -> str:
    """Return the id of a track: 12 hex digits of the SHA-256 of its places and times."""
    digest = hashlib.sha256()
    for column in (lat_deg, lon_deg, stamp_ns):
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()[:12]
