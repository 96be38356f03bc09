"""Clouds as PointCloud2: what other programs read out of the bytes."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.point_cloud import POINT_COLUMNS, PointCloud
from foretwin.telemetry.ros_messages.clouds import cloud_from
from foretwin.telemetry.ros_messages.table import messages_from

COVERS = ("foretwin.contracts.point_cloud",)


def test_each_field_is_found_where_it_is_said_to_be() -> None:
    points = np.arange(18, dtype=np.float32).reshape(3, 6)
    ros = cloud_from(PointCloud(stamp_ns=2_500_000_000, points=points))

    kinds = {4: "<u2", 7: "<f4"}
    found = {
        field.name: np.frombuffer(
            b"".join(
                ros.data[at + field.offset :][: np.dtype(kinds[field.datatype]).itemsize].tobytes()
                for at in range(0, ros.row_step, ros.point_step)
            ),
            kinds[field.datatype],
        ).tolist()
        for field in ros.fields
    }
    assert found == {name: points[:, k].tolist() for k, name in enumerate(POINT_COLUMNS)}
    assert (ros.height, ros.width, ros.header.frame_id) == (1, 3, "base_link")
    assert ros.is_dense
    assert (ros.header.stamp.sec, ros.header.stamp.nanosec) == (2, 500_000_000)


def test_an_empty_cloud_is_a_cloud() -> None:
    empty = PointCloud(stamp_ns=0, points=np.empty((0, 6), np.float32))
    (message,) = messages_from("point_cloud", empty, None)

    assert (message.topic, message.kind) == ("/foretwin/points", "sensor_msgs/msg/PointCloud2")
