"""The building blocks of ROS 2 messages: types, headers, vectors, turns, covariances."""

from __future__ import annotations

import dataclasses
import functools
import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame

MAP_FRAME, BASE_FRAME, ANTENNA_FRAME = "map", "base_link", "antenna"

NAV_SAT_FIX = "sensor_msgs/msg/NavSatFix"
IMU = "sensor_msgs/msg/Imu"
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
TWIST_WITH_COVARIANCE_STAMPED = "geometry_msgs/msg/TwistWithCovarianceStamped"
JOINT_STATE = "sensor_msgs/msg/JointState"
ODOMETRY = "nav_msgs/msg/Odometry"
STRING = "std_msgs/msg/String"
ACKERMANN = "ackermann_msgs/msg/AckermannDriveStamped"
STEERING_REPORT = "autoware_vehicle_msgs/msg/SteeringReport"
VELOCITY_REPORT = "autoware_vehicle_msgs/msg/VelocityReport"
CONTROL_MODE_REPORT = "autoware_vehicle_msgs/msg/ControlModeReport"
GEAR_REPORT = "autoware_vehicle_msgs/msg/GearReport"
TURN_INDICATORS_REPORT = "autoware_vehicle_msgs/msg/TurnIndicatorsReport"
HAZARD_LIGHTS_REPORT = "autoware_vehicle_msgs/msg/HazardLightsReport"
CONTROL = "autoware_control_msgs/msg/Control"
TRAJECTORY = "autoware_planning_msgs/msg/Trajectory"
LANELET_ROUTE = "autoware_planning_msgs/msg/LaneletRoute"
DETECTED_OBJECTS = "autoware_perception_msgs/msg/DetectedObjects"
PREDICTED_OBJECTS = "autoware_perception_msgs/msg/PredictedObjects"
TRACKED_OBJECTS = "autoware_perception_msgs/msg/TrackedObjects"
TRAFFIC_LIGHTS = "autoware_perception_msgs/msg/TrafficLightGroupArray"
TRAFFIC_SIGNALS = "autoware_auto_perception_msgs/msg/TrafficSignalArray"
POINT_CLOUD2 = "sensor_msgs/msg/PointCloud2"
RADAR_SCAN = "radar_msgs/msg/RadarScan"
TF = "tf2_msgs/msg/TFMessage"
CLOCK = "rosgraph_msgs/msg/Clock"


@functools.cache
def types_beside_ros() -> Typesdict:
    """Return the types of `autoware.msg`: Ackermann's, Autoware's and those of radars."""
    text = Path(__file__).with_name("autoware.msg").read_text(encoding="utf-8")
    return get_types_from_msg(text, "ackermann_msgs/msg/AckermannDrive")


@functools.cache
def typestore() -> Any:
    """Return the types of ROS 2 Jazzy and `types_beside_ros`; about 0.15 s at first."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(types_beside_ros())
    return store


@functools.cache
def schema_text(kind: str) -> str:
    """Return the `ros2msg` definition of a type with all it builds on."""
    return str(typestore().generate_msgdef(kind, ros_version=2)[0])


def stamp_ns_of(time: Any) -> int:
    """Return the nanoseconds of a ROS time."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def yaw_of(quaternion: Any) -> float:
    """Return the yaw of a ROS quaternion."""
    q = quaternion
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def ros_type(kind: str) -> Any:
    """Return the class of a full type name."""
    return typestore().types[kind]


def ros_message(kind: str, **fields: Any) -> Any:
    """Return a message of a full type name; what is not given is zero or empty, as in ROS."""
    return dataclasses.replace(_blank(kind), **fields)


@functools.cache
def _blank(kind: str) -> Any:
    fields = typestore().get_msgdef(kind).fields
    return ros_type(kind)(**{name: _zero(description) for name, description in fields})


def _zero(description: FieldDesc) -> Any:
    """Return the value of a field of which nothing is said."""
    match description:
        case (Nodetype.NAME, str(kind)):
            return _blank(kind)
        case (Nodetype.BASE, (str(name), _)):
            return "" if name == "string" else np.zeros(1, name)[0].item()
        case (Nodetype.ARRAY, ((Nodetype.BASE, (str(name), _)), int(length))):
            return np.zeros(length, name)
        case (Nodetype.SEQUENCE, ((Nodetype.BASE, (str(name), _)), _)) if name != "string":
            return np.zeros(0, name)
    return []


def time_from(stamp_ns: int) -> Any:
    """Return a ROS time."""
    return ros_type("builtin_interfaces/msg/Time")(*divmod(stamp_ns, 1_000_000_000))


def duration_from(duration_ns: int) -> Any:
    """Return a ROS duration."""
    return ros_type("builtin_interfaces/msg/Duration")(*divmod(duration_ns, 1_000_000_000))


def header_from(stamp_ns: int, frame_id: str) -> Any:
    """Return a header."""
    return ros_type("std_msgs/msg/Header")(time_from(stamp_ns), frame_id)


def vector_from(x: float, y: float, z: float) -> Any:
    """Return a Vector3."""
    return ros_type("geometry_msgs/msg/Vector3")(x, y, z)


def turn_from(yaw_rad: float) -> Any:
    """Return the quaternion of a yaw."""
    half = 0.5 * yaw_rad
    return ros_type("geometry_msgs/msg/Quaternion")(0.0, 0.0, math.sin(half), math.cos(half))


def pose_from(x_m: float, y_m: float, z_m: float, yaw_rad: float) -> Any:
    """Return a Pose."""
    point = ros_type("geometry_msgs/msg/Point")(x_m, y_m, z_m)
    return ros_type("geometry_msgs/msg/Pose")(point, turn_from(yaw_rad))


def twist_from(forward_mps: float, yaw_rate_radps: float) -> Any:
    """Return a planar twist."""
    forward, turning = vector_from(forward_mps, 0.0, 0.0), vector_from(0.0, 0.0, yaw_rate_radps)
    return ros_type("geometry_msgs/msg/Twist")(forward, turning)


def covariance(size: int, **diagonal: float) -> Array:
    """Return a flat square covariance; keys are `dN` for the element (N, N)."""
    flat = np.zeros(size * size)
    for name, value in diagonal.items():
        flat[int(name[1:]) * (size + 1)] = value
    return flat


def within_float32(value: float) -> float:
    """Keep a number within what 32 bits hold; NaN stays."""
    return min(max(value, -3.4e38), 3.4e38) if math.isfinite(value) else value


def json_string(message: msgspec.Struct, _frame: LocalFrame | None = None) -> Any:
    """Return a message as a String that holds its JSON."""
    return ros_type(STRING)(msgspec.json.encode(message).decode())
