"""Pictures of cameras as sensor_msgs/CompressedImage, with the CameraInfo of each."""

from __future__ import annotations

from typing import Any

import numpy as np

from foretwin.contracts.camera_image import CameraImage
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.ros_messages import parts

COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


def compressed_image_from(message: CameraImage, _frame: LocalFrame | None = None) -> Any:
    """Return the picture, in a frame whose z is the line of sight (REP 103: NAME_optical)."""
    data = np.frombuffer(message.jpeg, np.uint8)
    return parts.ros_message(COMPRESSED_IMAGE, header=_header(message), format="jpeg", data=data)


def camera_info_from(message: CameraImage, _frame: LocalFrame | None = None) -> Any:
    """Return the pinhole: without distortion; pixels are counted from the first one's middle."""
    across, down = (message.width_px - 1) / 2.0, (message.height_px - 1) / 2.0
    pinhole = np.array([[message.focal_px, 0, across], [0, message.focal_px, down], [0, 0, 1.0]])
    return parts.ros_message(
        CAMERA_INFO,
        header=_header(message),
        height=message.height_px,
        width=message.width_px,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=pinhole.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([pinhole, np.zeros(3)]).ravel(),
    )


def _header(message: CameraImage) -> Any:
    return parts.header_from(message.stamp_ns, f"{message.sensor or 'camera'}_optical")
