"""Every ROS 2 type that foretwin speaks: bytes to message and back, and the bytes themselves."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.telemetry.ros_messages import parts as ros_parts
from foretwin.telemetry.ros_messages.parts import ros_type, time_from, typestore
from tests.telemetry.ros_strategies import messages

COVERS = ("foretwin.telemetry.ros_messages.parts",)

KINDS = (
    ros_parts.NAV_SAT_FIX,
    ros_parts.IMU,
    ros_parts.ODOMETRY,
    ros_parts.TWIST_STAMPED,
    ros_parts.ACKERMANN,
    ros_parts.STEERING_REPORT,
    ros_parts.VELOCITY_REPORT,
    ros_parts.TRAJECTORY,
    ros_parts.DETECTED_OBJECTS,
    ros_parts.PREDICTED_OBJECTS,
    ros_parts.TRAFFIC_LIGHTS,
    ros_parts.CONTROL,
    ros_parts.CONTROL_MODE_REPORT,
    ros_parts.GEAR_REPORT,
    ros_parts.TURN_INDICATORS_REPORT,
    ros_parts.HAZARD_LIGHTS_REPORT,
    ros_parts.LANELET_ROUTE,
    ros_parts.TF,
    ros_parts.CLOCK,
)


@pytest.mark.parametrize("kind", KINDS)
@given(data=st.data())
@settings(max_examples=8, deadline=None)
def test_cdr_comes_back_byte_by_byte(kind: str, data: st.DataObject) -> None:
    store = typestore()
    before: Any = data.draw(messages(kind))
    cdr = bytes(store.serialize_cdr(before, kind))
    after = store.deserialize_cdr(cdr, kind)
    assert bytes(store.serialize_cdr(after, kind)) == cdr
    assert repr(after) == repr(before)


def test_bytes_of_reports_are_as_xcdr1_says() -> None:
    # Header 00 01 00 00: little-endian; then aligned fields: sec int32, nanosec uint32, the value.
    stamp = time_from(1_772_359_200_000_000_123)
    head = bytes([0, 1, 0, 0]) + struct.pack("<iI", 1_772_359_200, 123)
    store = typestore()
    steering = ros_type(ros_parts.STEERING_REPORT)(stamp=stamp, steering_tire_angle=0.25)
    assert store.serialize_cdr(steering, ros_parts.STEERING_REPORT) == head + struct.pack(
        "<f", 0.25
    )
    for kind, field in (
        (ros_parts.CONTROL_MODE_REPORT, "mode"),
        (ros_parts.GEAR_REPORT, "report"),
        (ros_parts.TURN_INDICATORS_REPORT, "report"),
    ):
        report = ros_type(kind)(stamp=stamp, **{field: 3})
        # One byte, and what aligns the whole to four where the encoder pads at all.
        assert bytes(store.serialize_cdr(report, kind)).rstrip(b"\0") == head + b"\x03"


def test_control_is_laid_out_as_its_three_parts() -> None:
    now = time_from(5_000_000_007)
    lateral = ros_type("autoware_control_msgs/msg/Lateral")(
        stamp=now,
        control_time=now,
        steering_tire_angle=0.5,
        steering_tire_rotation_rate=0.25,
        is_defined_steering_tire_rotation_rate=True,
    )
    longitudinal = ros_type("autoware_control_msgs/msg/Longitudinal")(
        stamp=now,
        control_time=now,
        velocity=8.0,
        acceleration=-1.5,
        jerk=0.0,
        is_defined_acceleration=True,
        is_defined_jerk=False,
    )
    control = ros_type(ros_parts.CONTROL)(
        stamp=now, control_time=now, lateral=lateral, longitudinal=longitudinal
    )
    time = struct.pack("<iI", 5, 7)
    assert bytes(typestore().serialize_cdr(control, ros_parts.CONTROL)) == (
        bytes([0, 1, 0, 0])
        + time
        + time
        + time
        + time
        + struct.pack("<ff?xxx", 0.5, 0.25, True)
        + time
        + time
        + struct.pack("<fff??", 8.0, -1.5, 0.0, True, False)
    )


@pytest.mark.parametrize(
    ("kind", "published"),
    [
        (ros_parts.STRING, "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        (ros_parts.IMU, "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"),
        (ros_parts.ODOMETRY, "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
        (ros_parts.TF, "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
        (ros_parts.CLOCK, "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"),
        (
            ros_parts.VELOCITY_REPORT,
            "9052adda949c32f4a98500abc1fb5bd23f2560e321eebdfbb25318d6108d4ce4",
        ),
        (
            ros_parts.STEERING_REPORT,
            "aa3acc9ca95ebc4daf9dec0ecf87911ad9c196392857c3026bfead589db65a94",
        ),
        (ros_parts.GEAR_REPORT, "4d14bc3f186c1a6af6a732bb5ebd540cdd742a56770012f4c3cb9e762de8f391"),
        (
            ros_parts.CONTROL_MODE_REPORT,
            "968feaa6441be3c3b161f2eb65972a4b15394d0a7ddc4664318551280d1ff222",
        ),
        (
            ros_parts.TURN_INDICATORS_REPORT,
            "c05a54cd244f1c9d683613b11c87a5b3ef816eed7a5f207368301221731a0964",
        ),
        (
            ros_parts.HAZARD_LIGHTS_REPORT,
            "01ce3b4293a5c2799fd7483b2d62a790e26fe8f2b5d60e48149163475685f28a",
        ),
        (ros_parts.CONTROL, "7818be59aa790ebb777db06e55a2c15e3756de4cc35c80b1e8271afc5bab2e9d"),
    ],
)
def test_type_hashes_are_those_that_ros_publishes(kind: str, published: str) -> None:
    # As printed by `ros2 topic info --verbose` and in the keys of rmw_zenoh.
    assert typestore().hash_rihs01(kind) == f"RIHS01_{published}"
