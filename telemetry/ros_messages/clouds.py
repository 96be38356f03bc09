"""Clouds of points as sensor_msgs/PointCloud2, laid out as Velodyne's ROS drivers do."""

from __future__ import annotations

from typing import Any

import numpy as np

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.point_cloud import PointCloud
from foretwin.telemetry.ros_messages import parts

_LAYOUT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"),
     ("time", "<f4")]
)  # fmt: skip
"""Without gaps, 22 bytes a point (velodyne_pointcloud, XYZIRT)."""
_FLOAT32, _UINT16 = 7, 4
"""sensor_msgs/PointField."""


def cloud_from(message: PointCloud, _frame: LocalFrame | None = None) -> Any:
    """Return the PointCloud2 of a cloud, in base_link, its stamp that of the turn's beginning.

    Each point is where base_link was when it was measured: `time` is for who removes the skew.
    """
    packed = np.empty(len(message.points), dtype=_LAYOUT)
    names = _LAYOUT.names or ()
    for column, name in enumerate(names):
        packed[name] = message.points[:, column]
    fields = [
        parts.ros_message(
            "sensor_msgs/msg/PointField",
            name=name,
            offset=_LAYOUT.fields[name][1],  # type: ignore[index]
            datatype=_UINT16 if name == "ring" else _FLOAT32,
            count=1,
        )
        for name in names
    ]
    return parts.ros_message(
        parts.POINT_CLOUD2,
        header=parts.header_from(message.stamp_ns, parts.BASE_FRAME),
        height=1,
        width=len(packed),
        fields=fields,
        point_step=_LAYOUT.itemsize,
        row_step=packed.nbytes,
        data=packed.view(np.uint8).reshape(-1),
        is_dense=True,
    )
