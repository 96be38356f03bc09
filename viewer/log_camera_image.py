"""Pictures of virtual cameras as rows: at the car, as each camera sits on it."""

from __future__ import annotations

import rerun as rr

from foretwin.contracts.camera_image import CameraImage
from foretwin.contracts.point_cloud import base_from_mount, origin_m
from foretwin.viewer.rows import Row, static

PATH = "world/ego/real/camera"
_IN_SCENE_M = 1.5
"""How far before the camera its picture is drawn in the scene."""


class CameraImageLog:
    """Turns pictures into rows; where a camera sits is told with its first one."""

    def __init__(self) -> None:
        self._known: set[str] = set()

    def rows(self, message: CameraImage, drive_ns: int) -> list[Row]:
        """Return the picture, after the camera itself where it is the first."""
        path = f"{PATH}/{rr.escape_entity_path_part(message.sensor or 'sensor')}"
        shown = rr.EncodedImage(contents=message.jpeg, media_type="image/jpeg")
        picture = Row(path, drive_ns, shown)
        if message.sensor in self._known:
            return [picture]
        self._known.add(message.sensor)
        sits = rr.Transform3D(
            translation=origin_m(message.mount), mat3x3=base_from_mount(message.mount)
        )
        pinhole = rr.Pinhole(
            focal_length=message.focal_px,
            width=message.width_px,
            height=message.height_px,
            camera_xyz=rr.ViewCoordinates.FLU,
            image_plane_distance=_IN_SCENE_M,
        )
        return [static(path, sits), static(path, pinhole), picture]
