"""What a camera saw, as one message."""

from __future__ import annotations

import msgspec

from foretwin.contracts.point_cloud import Mount


class CameraImage(msgspec.Struct, frozen=True, kw_only=True):
    """One picture at `stamp_ns`, of a pinhole without distortion that looks along the mount's x."""

    stamp_ns: int
    jpeg: bytes
    width_px: int
    height_px: int
    focal_px: float
    sensor: str = ""
    mount: Mount = Mount()
    """Where the camera sits."""
