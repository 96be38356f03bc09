"""Pictures on screen: at the car as the camera sits on it, which is told once."""

from __future__ import annotations

import rerun as rr

from foretwin.contracts.camera_image import CameraImage
from foretwin.contracts.point_cloud import Mount
from foretwin.viewer.log_camera_image import PATH, CameraImageLog
from tests.viewer.test_log_road_users import cells


def image(sensor: str = "a b") -> CameraImage:
    return CameraImage(
        stamp_ns=0, jpeg=b"\xff\xd8x", width_px=64, height_px=48, focal_px=40.0, sensor=sensor,
        mount=Mount(forward_m=1.7, left_m=0.5, up_m=1.5, yaw_deg=90.0),
    )  # fmt: skip


def test_where_a_camera_sits_is_told_with_its_first_picture() -> None:
    log = CameraImageLog()
    sits, pinhole, picture = log.rows(image(), 7)

    assert {row.path for row in (sits, pinhole, picture)} == {f"{PATH}/a\\ b"}
    assert (sits.drive_ns, pinhole.drive_ns, picture.drive_ns) == (None, None, 7)
    assert isinstance(sits.components, rr.Transform3D)
    assert cells(sits.components.translation) == [[1.7000000476837158, 0.5, 1.5]]
    assert isinstance(pinhole.components, rr.Pinhole)
    assert cells(pinhole.components.resolution) == [[64.0, 48.0]]
    assert isinstance(picture.components, rr.EncodedImage)
    assert len(log.rows(image(), 8)) == 1
    assert len(log.rows(image("another"), 9)) == 3
