"""Lists of radars as RadarScan: what other programs read out of the bytes."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.point_cloud import Mount
from foretwin.contracts.radar_list import RadarList, base_places
from foretwin.telemetry.ros_messages.parts import RADAR_SCAN, schema_text, typestore
from foretwin.telemetry.ros_messages.radars import radar_scan_from
from foretwin.telemetry.ros_messages.table import messages_from

COVERS = ("foretwin.contracts.radar_list",)
LIST = RadarList(
    stamp_ns=2_500_000_000, sensor="front", mount=Mount(forward_m=3.0, left_m=1.0, yaw_deg=90.0),
    returns=np.array([[20.0, 0.25, -0.125, -3.5, 10.0], [7.0, -1.0, 0.0, 2.0, -5.0]], np.float32),
)  # fmt: skip


def test_each_return_is_read_as_it_was_measured() -> None:
    (message,) = messages_from("radar_list", LIST, None)
    ros = typestore().deserialize_cdr(message.data, message.kind)

    assert (message.topic, message.kind) == ("/foretwin/radar", RADAR_SCAN)
    assert [
        (one.range, one.azimuth, one.elevation, one.doppler_velocity, one.amplitude)
        for one in ros.returns
    ] == [(20.0, 0.25, -0.125, -3.5, 10.0), (7.0, -1.0, 0.0, 2.0, -5.0)]
    assert (ros.header.stamp.sec, ros.header.stamp.nanosec) == (2, 500_000_000)
    assert ros.header.frame_id == "front"
    assert radar_scan_from(LIST, frame_id="radar_front").header.frame_id == "radar_front"


def test_the_layout_is_that_of_radar_msgs() -> None:
    """As its files of the ROS 2 branch have it: CDR knows order and types alone."""
    scan, _, more = schema_text(RADAR_SCAN).partition("=" * 20)
    assert scan.split() == ["std_msgs/Header", "header", "radar_msgs/RadarReturn[]", "returns"]
    of_return = more.partition("MSG: radar_msgs/RadarReturn")[2].split("=" * 20)[0]
    assert of_return.split() == [
        "float32", "range", "float32", "azimuth", "float32", "elevation",
        "float32", "doppler_velocity", "float32", "amplitude",
    ]  # fmt: skip


def test_returns_have_their_places_at_the_car() -> None:
    """The sensor looks to the left: what is before it is to the left of the car."""
    ahead = RadarList(
        stamp_ns=0, mount=Mount(forward_m=3.0, left_m=1.0, up_m=0.5, yaw_deg=90.0),
        returns=np.array([[10.0, 0.0, 0.0, 0, 0], [10.0, np.pi / 2, 0.0, 0, 0],
                          [10.0, 0.0, np.pi / 6, 0, 0]], np.float32),
    )  # fmt: skip
    wanted = [[3.0, 11.0, 0.5], [-7.0, 1.0, 0.5], [3.0, 1.0 + 75.0**0.5, 5.5]]
    assert base_places(ahead) == pytest.approx(np.array(wanted), abs=1e-5)
