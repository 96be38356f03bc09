"""Messages of the drive as ROS 2 messages in CDR, and back.

| channel | topic | type | exact |
|---|---|---|---|
| gnss | /foretwin/gnss | sensor_msgs/NavSatFix | yes |
| imu | /foretwin/imu | sensor_msgs/Imu, no orientation | yes |
| speed | /foretwin/speed | geometry_msgs/TwistStamped | yes |
| heading | /foretwin/heading | sensor_msgs/Imu, orientation (and rate about z) alone | 1e-15 rad |
| steering | /foretwin/steering | sensor_msgs/JointState: steering_wheel, tire | yes |
| plan | /foretwin/plan | autoware_planning_msgs/Trajectory in the local frame | 1e-9 deg |
| status, objects, signals, end | /foretwin/NAME | std_msgs/String, JSON | yes |
| control, state | /foretwin/NAME_json | std_msgs/String, JSON | yes |

Views for other programs, not read back since they hold less (32-bit numbers, fewer fields):
/foretwin/steering_report (autoware_vehicle_msgs/SteeringReport), /foretwin/control
(ackermann_msgs/AckermannDriveStamped), /foretwin/state (nav_msgs/Odometry, local frame).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.keys import CHANNELS
from foretwin.telemetry.ros_messages.motion import (
    plan_from_trajectory,
    ros_from_control,
    ros_from_plan,
    ros_from_state,
)
from foretwin.telemetry.ros_messages.parts import (
    IMU,
    JOINT_STATE,
    NAV_SAT_FIX,
    STRING,
    TRAJECTORY,
    TWIST_STAMPED,
    Parts,
    json_string,
    typestore,
)
from foretwin.telemetry.ros_messages.sensors import (
    gnss_from_ros,
    heading_from_ros,
    imu_from_ros,
    ros_from_gnss,
    ros_from_heading,
    ros_from_imu,
    ros_from_speed,
    ros_from_steering,
    speed_from_ros,
    steering_from_ros,
)

TOPIC_PREFIX = "/foretwin/"
INFO_TOPIC, FRAME_TOPIC = f"{TOPIC_PREFIX}vehicle_info", f"{TOPIC_PREFIX}frame"
"""Of bags: std_msgs/String with the JSON of VehicleInfo and of the LocalFrame named "map"."""
_JSON_ALONE = ("status", "objects", "signals", "end")
_JSON_BESIDE_A_VIEW = ("control", "state")


class RosMessage(NamedTuple):
    """One message ready for a file: topic, full type name, CDR bytes."""

    topic: str
    kind: str
    data: bytes


def messages_from(
    channel: str, message: msgspec.Struct, frame: LocalFrame | None
) -> list[RosMessage]:
    """Return the ROS 2 messages of one message; `frame` is the local frame of plan and state.

    Raises ValueError for a channel that is not written, a stamp that a ROS time cannot hold
    (before 1970 or after 2038-01-19), or a plan or state without a frame.
    """
    if channel in ("plan", "state") and frame is None:
        raise ValueError(f"{channel}: needs a local frame")
    if not 0 <= message.stamp_ns < 2**31 * 10**9:  # type: ignore[attr-defined]
        raise ValueError(
            f"{channel}: stamp {message.stamp_ns} ns fits no ROS time (1970 to 2038)"  # type: ignore[attr-defined]
        )
    if channel in _WRITERS:
        parts = _WRITERS[channel](message, frame)
    elif channel in _JSON_ALONE:
        parts = [(channel, STRING, json_string(message))]
    else:
        raise ValueError(f"channel {channel!r} is not written; known: {', '.join(written())}")
    store = typestore()
    return [
        RosMessage(TOPIC_PREFIX + name, kind, bytes(store.serialize_cdr(ros, kind)))
        for name, kind, ros in parts
    ]


def written() -> tuple[str, ...]:
    """Return the channels that can be written."""
    return (*_WRITERS, *_JSON_ALONE)


def kind_of(topic: str) -> str | None:
    """Return the type of one of our own topics that is read back, None for any other."""
    name = topic.removeprefix(TOPIC_PREFIX)
    if topic == name:
        return None
    channel = name.removesuffix("_json")
    if channel in _JSON_ALONE or (channel in _JSON_BESIDE_A_VIEW and channel != name):
        return STRING
    return _READERS[name][0] if name in _READERS else None


def message_of(topic: str, ros: Any, frame: LocalFrame | None) -> tuple[str, msgspec.Struct]:
    """Return channel and message of a decoded message of a topic that has a `kind_of`."""
    name = topic.removeprefix(TOPIC_PREFIX)
    if kind_of(topic) == STRING:
        channel = name.removesuffix("_json")
        return channel, msgspec.json.decode(ros.data, type=CHANNELS[channel].kind)
    return name, _READERS[name][1](ros, frame)


_WRITERS: dict[str, Callable[[Any, LocalFrame | None], Parts]] = {
    "gnss": ros_from_gnss,
    "imu": ros_from_imu,
    "speed": ros_from_speed,
    "heading": ros_from_heading,
    "steering": ros_from_steering,
    "control": ros_from_control,
    "plan": ros_from_plan,
    "state": ros_from_state,
}
_READERS: dict[str, tuple[str, Callable[[Any, LocalFrame | None], msgspec.Struct]]] = {
    "gnss": (NAV_SAT_FIX, gnss_from_ros),
    "imu": (IMU, imu_from_ros),
    "speed": (TWIST_STAMPED, speed_from_ros),
    "heading": (IMU, heading_from_ros),
    "steering": (JOINT_STATE, steering_from_ros),
    "plan": (TRAJECTORY, plan_from_trajectory),
}
