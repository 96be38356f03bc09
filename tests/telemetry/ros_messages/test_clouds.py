"""Clouds as PointCloud2: what other programs read out of the bytes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from foretwin.contracts.point_cloud import POINT_COLUMNS, PointCloud
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.clouds import cloud_from, cloud_of
from foretwin.telemetry.ros_messages.foreign import UnusableError
from foretwin.telemetry.ros_messages.table import messages_from


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


CLOUD = np.array([[3.0, 4.0, 0.0, 12.4, 5.0, 0.025], [0.0, -2.0, 2.0, 300.0, 0.0, 0.0]], np.float32)


def test_autoware_gets_the_point_type_that_it_asks_drivers_for() -> None:
    ros = cloud_from(PointCloud(stamp_ns=7, points=CLOUD), layout="autoware", frame_id="top")
    names = ["x", "y", "z", "intensity", "return_type", "channel"]
    names += ["azimuth", "elevation", "distance", "time_stamp"]
    assert [one.name for one in ros.fields] == names
    assert [one.offset for one in ros.fields] == [0, 4, 8, 12, 13, 14, 16, 20, 24, 28]
    assert [one.datatype for one in ros.fields] == [7, 7, 7, 2, 2, 4, 7, 7, 7, 6]
    assert (ros.point_step, ros.header.frame_id) == (32, "top")
    kinds = {7: "<f4", 2: "u1", 4: "<u2", 6: "<u4"}
    layout = np.dtype([(one.name, kinds[one.datatype]) for one in ros.fields])
    first, second = np.frombuffer(ros.data.tobytes(), layout)
    assert (first["intensity"], first["channel"], first["return_type"]) == (12, 5, 1)
    assert first["azimuth"] == pytest.approx(np.arctan2(4.0, 3.0))
    assert first["distance"] == pytest.approx(5.0)
    assert abs(int(first["time_stamp"]) - 25_000_000) < 5
    assert second["elevation"] == pytest.approx(np.pi / 4)
    assert second["intensity"] == 255


def test_both_layouts_are_read_back() -> None:
    cloud = PointCloud(stamp_ns=7, points=CLOUD)
    assert cloud_of(cloud_from(cloud), 7).points == pytest.approx(CLOUD)
    read = cloud_of(cloud_from(cloud, layout="autoware"), 7, sensor="top")
    assert read.points[:, [0, 1, 2, 4, 5]] == pytest.approx(CLOUD[:, [0, 1, 2, 4, 5]])
    assert (read.points[:, 3].tolist(), read.stamp_ns, read.sensor) == ([12.0, 255.0], 7, "top")


def test_times_before_the_stamp_are_of_a_turn_that_is_stamped_at_its_end() -> None:
    points = CLOUD.copy()
    points[:, 5] = (-0.1, -0.05)
    read = cloud_of(cloud_from(PointCloud(stamp_ns=0, points=points)), 10**9)
    assert read.stamp_ns == pytest.approx(9 * 10**8, abs=100)
    assert read.points[:, 5] == pytest.approx([0.0, 0.05], abs=1e-6)


def test_an_organised_cloud_without_more_than_places_and_with_gaps_is_read() -> None:
    layout = np.dtype([("x", ">f8"), ("y", ">f8"), ("z", ">f8")])
    told = np.zeros((2, 3), layout)
    told["x"] = [[1.0, np.nan, 0.0], [4.0, 5.0, 6.0]]
    rows = np.concatenate([told.view(np.uint8).reshape(2, 72), np.full((2, 5), 9, np.uint8)], 1)
    field = "sensor_msgs/msg/PointField"
    ros = parts.ros_message(
        parts.POINT_CLOUD2, height=2, width=3, point_step=24, row_step=77, is_bigendian=True,
        fields=[
            parts.ros_message(field, name=name, offset=8 * k, datatype=8, count=1)
            for k, name in enumerate("xyz")
        ],
        data=rows.reshape(-1),
    )  # fmt: skip
    assert cloud_of(ros, 0).points[:, 0].tolist() == [1.0, 4.0, 5.0, 6.0]
    assert not cloud_of(ros, 0).points[:, 1:].any()
    for wrong, why in (
        ({"data": rows.reshape(-1)[:-1]}, "fewer bytes"),
        ({"point_step": 20, "row_step": 77}, "beyond"),
        ({"width": 2**20, "height": 2}, "more than"),
        ({"fields": ros.fields[:2]}, "no x, y, z"),
    ):
        with pytest.raises(UnusableError, match=why):
            cloud_of(dataclasses.replace(ros, **wrong), 0)
