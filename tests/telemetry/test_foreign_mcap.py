"""MCAP files of other programs: chosen by type, stamped by header, put in order."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs import LogError, open_log
from foretwin.telemetry.ros_messages.parts import (
    header_from,
    ros_type,
    schema_text,
    time_from,
    twist_from,
    typestore,
    vector_from,
)
from foretwin.telemetry.ros_messages.table import messages_from

COVERS = (
    "foretwin.telemetry.logs.foreign_ros",
    "foretwin.telemetry.logs.ros_recording",
)

START_NS = 1_772_359_200_000_000_000
LAG_NS = 30_000_000


class ForeignFile:
    """Writes messages of any type, as ros2 bag record would: log time is the time of receipt."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._bytes = io.BytesIO()
        self._writer = Writer(self._bytes)
        self._writer.start(profile="ros2", library="another program")
        self._channels: dict[tuple[str, str], int] = {}

    def add(self, topic: str, kind: str, message: Any, log_time_ns: int) -> None:
        if (topic, kind) not in self._channels:
            schema = self._writer.register_schema(kind, "ros2msg", schema_text(kind).encode())
            self._channels[topic, kind] = self._writer.register_channel(topic, "cdr", schema)
        self._writer.add_message(
            self._channels[topic, kind],
            log_time=log_time_ns,
            publish_time=log_time_ns,
            data=bytes(typestore().serialize_cdr(message, kind)),
        )

    def close(self) -> Path:
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._path.write_bytes(self._bytes.getvalue())
        return self._path


def fix(stamp_ns: int, lat_deg: float, *, status: int = 0) -> Any:
    sample = drive.GnssFix(stamp_ns=stamp_ns, position=GeoPoint(lat_deg, 13.4, 30.0), std_m=0.5)
    part = messages_from("gnss", sample, None)[0]
    message: Any = typestore().deserialize_cdr(part.data, part.kind)
    message.status.status = status
    return message


def velocity(stamp_ns: int, speed_mps: float) -> Any:
    return ros_type("autoware_vehicle_msgs/msg/VelocityReport")(
        header=header_from(stamp_ns, "base_link"),
        longitudinal_velocity=speed_mps,
        lateral_velocity=0.0,
        heading_rate=0.0,
    )


def control(stamp_ns: int, tire_rad: float, accel_mps2: float) -> Any:
    now = time_from(stamp_ns)
    return ros_type("autoware_control_msgs/msg/Control")(
        stamp=now,
        control_time=now,
        lateral=ros_type("autoware_control_msgs/msg/Lateral")(
            stamp=now,
            control_time=now,
            steering_tire_angle=tire_rad,
            steering_tire_rotation_rate=0.0,
            is_defined_steering_tire_rotation_rate=False,
        ),
        longitudinal=ros_type("autoware_control_msgs/msg/Longitudinal")(
            stamp=now,
            control_time=now,
            velocity=0.0,
            acceleration=accel_mps2,
            jerk=0.0,
            is_defined_acceleration=True,
            is_defined_jerk=False,
        ),
    )


def test_an_autoware_recording_becomes_a_log(tmp_path: Path) -> None:
    file = ForeignFile(tmp_path / "autoware.mcap")
    report = ros_type("autoware_vehicle_msgs/msg/SteeringReport")
    for tick in range(10):
        at = START_NS + tick * 100_000_000
        # The fix arrives late, after younger messages.
        file.add("/sensing/gnss/fix", "sensor_msgs/msg/NavSatFix", fix(at, 52.5), at + LAG_NS)
        kind = "autoware_vehicle_msgs/msg/VelocityReport"
        file.add("/vehicle/status/velocity", kind, velocity(at + 10**7, 8.0), at + 10**7)
        kind = "autoware_vehicle_msgs/msg/SteeringReport"
        steering = report(stamp=time_from(at + 2 * 10**7), steering_tire_angle=0.25)
        file.add("/vehicle/status/steering", kind, steering, at + 2 * 10**7)
        kind = "autoware_control_msgs/msg/Control"
        file.add("/control/command", kind, control(at + 3 * 10**7, -0.125, 0.5), at + 3 * 10**7)
        twist = ros_type("geometry_msgs/msg/TwistStamped")(
            header=header_from(at, "base_link"), twist=twist_from(99.0, 0.0)
        )
        file.add("/other/speed", "geometry_msgs/msg/TwistStamped", twist, at)
    log = open_log(file.close())
    found = list(log.samples())
    assert set(log.info.sends) == {"gnss", "speed", "steering", "control"}
    assert [m.stamp_ns for _, m in found] == sorted(m.stamp_ns for _, m in found)  # type: ignore[attr-defined]
    assert [channel for channel, _ in found[:4]] == ["gnss", "speed", "steering", "control"]
    gnss, speed, steering, command = (message for _, message in found[:4])
    assert gnss == drive.GnssFix(stamp_ns=START_NS, position=GeoPoint(52.5, 13.4, 30.0), std_m=0.5)
    assert speed == drive.SpeedSample(stamp_ns=START_NS + 10**7, speed_mps=8.0)
    assert steering == drive.SteeringSample(stamp_ns=START_NS + 2 * 10**7, tire_angle_rad=0.25)
    assert command == drive.ControlCommand(
        stamp_ns=START_NS + 3 * 10**7, accel_mps2=0.5, tire_angle_rad=-0.125
    )
    assert log.info.time_base == "utc"
    assert not log.skipped


def test_no_fix_zero_stamp_and_imu_without_values(tmp_path: Path) -> None:
    file = ForeignFile(tmp_path / "bag.mcap")
    kind = "sensor_msgs/msg/NavSatFix"
    file.add("/fix", kind, fix(START_NS, 52.5, status=-1), START_NS)
    file.add("/fix", kind, fix(0, 52.6), START_NS + 10**9)
    file.add("/fix", kind, fix(START_NS + 2 * 10**9, float("nan")), START_NS + 2 * 10**9)
    imu = drive.ImuSample(stamp_ns=START_NS, accel_mps2=(0.0, 0.0, 9.8), rate_radps=(0.0, 0.0, 0.0))
    part = messages_from("imu", imu, None)[0]
    message: Any = typestore().deserialize_cdr(part.data, part.kind)
    message.angular_velocity_covariance = np.full(9, -1.0)
    file.add("/imu", part.kind, message, START_NS)
    log = open_log(file.close())
    found = list(log.samples())
    assert [(channel, m.stamp_ns) for channel, m in found] == [("gnss", START_NS + 10**9)]  # type: ignore[attr-defined]
    assert log.skipped == {
        "receiver without fix": 1,
        "imu without turning rates": 1,
        "position not finite": 1,
    }


def test_a_gyro_without_an_accelerometer_is_read_and_written_so(tmp_path: Path) -> None:
    """Imu.msg: "set element 0 of the associated covariance matrix to -1"."""
    file = ForeignFile(tmp_path / "bag.mcap")
    file.add("/fix", "sensor_msgs/msg/NavSatFix", fix(START_NS, 52.5), START_NS)
    imu = drive.ImuSample(stamp_ns=START_NS, accel_mps2=(0.0, 0.0, 0.0), rate_radps=(0.0, 0.0, 0.2))
    part = messages_from("imu", imu, None)[0]
    message: Any = typestore().deserialize_cdr(part.data, part.kind)
    assert message.linear_acceleration_covariance[0] == -1.0
    message.linear_acceleration.x = 3.0  # whatever stands there
    file.add("/imu", part.kind, message, START_NS)
    assert dict(open_log(file.close()).samples())["imu"] == imu


@pytest.mark.parametrize("variance", [float("nan"), 0.0, -1.0])
def test_a_receiver_that_tells_no_covariance_is_of_unknown_spread(
    tmp_path: Path, variance: float
) -> None:
    file = ForeignFile(tmp_path / "bag.mcap")
    message = fix(START_NS, 52.5)
    message.position_covariance = np.full(9, variance)
    assert message.position_covariance_type != 0
    file.add("/fix", "sensor_msgs/msg/NavSatFix", message, START_NS)
    log = open_log(file.close())
    position = GeoPoint(52.5, 13.4, 30.0)
    wanted = drive.GnssFix(stamp_ns=START_NS, position=position, std_m=None)
    assert list(log.samples()) == [("gnss", wanted)]


def test_a_file_without_positions_is_no_log(tmp_path: Path) -> None:
    file = ForeignFile(tmp_path / "bag.mcap")
    file.add("/twist", "geometry_msgs/msg/Vector3", vector_from(1.0, 2.0, 3.0), 5)
    with pytest.raises(
        LogError, match=r"bag\.mcap: no topic of type sensor_msgs/msg/NavSatFix.*geometry_msgs"
    ):
        open_log(file.close())
