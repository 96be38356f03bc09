"""Every ROS 2 type that foretwin speaks: bytes to message and back, and the bytes themselves."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from telemetry import ros_parts
from telemetry.ros_parts import ros_type, time_from, typestore
from tests.telemetry.ros_strategies import messages

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
        stamp=now, control_time=now, steering_tire_angle=0.5, steering_tire_rotation_rate=0.25,
        is_defined_steering_tire_rotation_rate=True,
    )  # fmt: skip
    longitudinal = ros_type("autoware_control_msgs/msg/Longitudinal")(
        stamp=now, control_time=now, velocity=8.0, acceleration=-1.5, jerk=0.0,
        is_defined_acceleration=True, is_defined_jerk=False,
    )  # fmt: skip
    control = ros_type(ros_parts.CONTROL)(
        stamp=now, control_time=now, lateral=lateral, longitudinal=longitudinal
    )
    time = struct.pack("<iI", 5, 7)
    assert bytes(typestore().serialize_cdr(control, ros_parts.CONTROL)) == (
        bytes([0, 1, 0, 0]) + time + time
        + time + time + struct.pack("<ff?xxx", 0.5, 0.25, True)
        + time + time + struct.pack("<fff??", 8.0, -1.5, 0.0, True, False)
    )  # fmt: skip
