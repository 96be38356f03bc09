"""What a lidar measured, as one message, and where it sits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Array32

POINT_COLUMNS = ("x", "y", "z", "intensity", "ring", "time")
"""Of a cloud (N, 6): metres in base_link when the point was measured, percent of the light, the
ring from the lowest on, and seconds since the turn began."""
MOST_RAYS = 262_144
"""Of one turn: twice the largest of the market, 128 rings of 1,024 azimuths."""


class PointCloud(msgspec.Struct, frozen=True, kw_only=True):
    """One turn of a lidar, which began at `stamp_ns`; `points` (N, 6) are `POINT_COLUMNS`."""

    stamp_ns: int
    points: Array32
    sensor: str = ""


class Mount(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where a sensor sits on the car, from base_link: the rear axle's middle on the ground."""

    forward_m: float = 1.4
    """Ahead of the rear axle: 1.4 is above the middle of a compact car's roof."""
    left_m: float = 0.0
    """To the left of the middle."""
    up_m: float = 1.9
    """Above the ground."""
    yaw_deg: float = 0.0
    """Turned to the left."""
    pitch_deg: float = 0.0
    """Nose down."""
    roll_deg: float = 0.0
    """Left side up."""


Mounts = Mapping[str, Mount]
"""Where sensors sit, by their names."""
NO_MOUNTS: Mounts = MappingProxyType({})


def base_from_mount(mount: Mount) -> Array:
    """Return (3, 3) what turns the sensor's axes into those of base_link (roll, pitch, yaw)."""
    yaw, pitch, roll = map(math.radians, (mount.yaw_deg, mount.pitch_deg, mount.roll_deg))
    (cy, sy), (cp, sp), (cr, sr) = ((math.cos(a), math.sin(a)) for a in (yaw, pitch, roll))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def origin_m(mount: Mount) -> Array:
    """Return (3,) where a sensor is in base_link."""
    return np.array([mount.forward_m, mount.left_m, mount.up_m])


def mount_from_base_cloud(points: Array32, mount: Mount) -> Array32:
    """Return a cloud (N, 6) in the sensor's own axes."""
    found = points.copy()
    found[:, :3] = (points[:, :3] - origin_m(mount)) @ base_from_mount(mount)
    return found


def base_from_mount_cloud(points: Array32, mount: Mount) -> Array32:
    """Return a cloud (N, 6) of the sensor's own axes in base_link."""
    found = points.copy()
    found[:, :3] = points[:, :3] @ base_from_mount(mount).T + origin_m(mount)
    return found
