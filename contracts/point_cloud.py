"""What a lidar measured, as one message."""

from __future__ import annotations

import msgspec

from foretwin.contracts.arrays import Array32

POINT_COLUMNS = ("x", "y", "z", "intensity", "ring", "time")
"""Of a cloud (N, 6): metres in base_link when the point was measured, percent of the light, the
ring from the lowest on, and seconds since the turn began."""


class PointCloud(msgspec.Struct, frozen=True, kw_only=True):
    """One turn of a lidar, which began at `stamp_ns`; `points` (N, 6) are `POINT_COLUMNS`."""

    stamp_ns: int
    points: Array32
    sensor: str = ""
