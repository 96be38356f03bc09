"""Pictures as CompressedImage and CameraInfo: what other programs read out of the bytes."""

from __future__ import annotations

from foretwin.contracts.camera_image import CameraImage
from foretwin.telemetry.ros_messages.parts import typestore
from foretwin.telemetry.ros_messages.table import messages_from

COVERS = ("foretwin.contracts.camera_image",)
IMAGE = CameraImage(
    stamp_ns=2_500_000_000, jpeg=b"\xff\xd8picture", width_px=640, height_px=480, focal_px=457.0,
    sensor="front",
)  # fmt: skip


def test_a_picture_comes_with_its_pinhole() -> None:
    picture, info = messages_from("camera_image", IMAGE, None)
    image = typestore().deserialize_cdr(picture.data, picture.kind)
    camera = typestore().deserialize_cdr(info.data, info.kind)

    assert (picture.topic, info.topic) == (
        "/foretwin/camera/compressed", "/foretwin/camera/camera_info"
    )  # fmt: skip
    assert (image.format, image.data.tobytes()) == ("jpeg", IMAGE.jpeg)
    assert image.header == camera.header
    assert (image.header.frame_id, image.header.stamp.sec) == ("front_optical", 2)
    assert (camera.width, camera.height, camera.distortion_model) == (640, 480, "plumb_bob")
    assert camera.k.tolist() == [457.0, 0.0, 319.5, 0.0, 457.0, 239.5, 0.0, 0.0, 1.0]
    assert camera.p.tolist() == [
        457.0, 0.0, 319.5, 0.0, 0.0, 457.0, 239.5, 0.0, 0.0, 0.0, 1.0, 0.0
    ]  # fmt: skip
    assert camera.r.tolist() == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    assert camera.d.tolist() == [0.0] * 5
