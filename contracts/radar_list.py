"""What a radar measured, as one message."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array32
from foretwin.contracts.point_cloud import Mount, base_from_mount, origin_m

RADAR_COLUMNS = ("range", "azimuth", "elevation", "range_rate", "amplitude")
"""Of a list (N, 5), in the sensor's own axes: metres, radians to the left and upwards, m/s (below 0
what comes nearer), and the radar cross section in dB of a square metre."""


class RadarList(msgspec.Struct, frozen=True, kw_only=True):
    """One list of a radar at `stamp_ns`; `returns` (N, 5) are `RADAR_COLUMNS`."""

    stamp_ns: int
    returns: Array32
    sensor: str = ""
    mount: Mount = Mount()
    """Where the sensor sits."""


def base_places(message: RadarList) -> Array32:
    """Return (N, 3) where the returns are in base_link, metres."""
    range_m, azimuth, elevation = message.returns[:, :3].astype(np.float64).T
    flat = range_m * np.cos(elevation)
    own = [flat * np.cos(azimuth), flat * np.sin(azimuth), range_m * np.sin(elevation)]
    places = np.stack(own, axis=1) @ base_from_mount(message.mount).T + origin_m(message.mount)
    return places.astype(np.float32)
