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
(ackermann_msgs/AckermannDriveStamped), /foretwin/state (nav_msgs/Odometry, local frame),
/foretwin/points (sensor_msgs/PointCloud2), /foretwin/radar (radar_msgs/RadarScan),
/foretwin/camera/compressed (sensor_msgs/CompressedImage) and /foretwin/camera/camera_info,
/foretwin/sensed_gnss (sensor_msgs/NavSatFix) and /foretwin/sensed_imu (sensor_msgs/Imu).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.keys import CHANNELS, TELEMETRY_CHANNELS
from foretwin.telemetry.ros_messages import (
    clouds,
    commands,
    motion,
    parts,
    pictures,
    radars,
    sensed,
    sensors,
)
from foretwin.telemetry.ros_messages.foreign import FOREIGN, Messages, plan_as_told, stamp_of
from foretwin.telemetry.ros_messages.parts import STRING, json_string, typestore

TOPIC_PREFIX = "/foretwin/"
INFO_TOPIC, FRAME_TOPIC = f"{TOPIC_PREFIX}vehicle_info", f"{TOPIC_PREFIX}frame"
"""Of bags: std_msgs/String with the JSON of VehicleInfo and of the LocalFrame named "map"."""


class _Topic(NamedTuple):
    """One topic of a channel below our prefix; what has no `read` is a view for other programs.

    `write` returns a message of type `kind`, or None where there is nothing to show.
    """

    name: str
    kind: str
    write: Callable[[Any, LocalFrame | None], Any]
    read: Callable[[Any, int, LocalFrame | None], Messages] | None = None


def _json(channel: str, name: str) -> _Topic:
    def read(ros: Any, _stamp_ns: int, _frame: LocalFrame | None) -> Messages:
        return (msgspec.json.decode(ros.data, type=CHANNELS[channel].kind),)

    return _Topic(name, STRING, json_string, read)


def _typed(name: str, kind: str, write: Callable[[Any, LocalFrame | None], Any]) -> _Topic:
    return _Topic(name, kind, write, FOREIGN[kind].read)


def _exact(
    name: str,
    kind: str,
    write: Callable[[Any, LocalFrame | None], Any],
    read: Callable[[Any, int], msgspec.Struct],
) -> _Topic:
    return _Topic(name, kind, write, lambda ros, stamp_ns, _: (read(ros, stamp_ns),))


_TOPICS: dict[str, tuple[_Topic, ...]] = {
    **{channel: (_json(channel, channel),) for channel in TELEMETRY_CHANNELS},
    "gnss": (_exact("gnss", parts.NAV_SAT_FIX, sensors.ros_from_gnss, sensors.gnss_from_ros),),
    "imu": (_typed("imu", parts.IMU, sensors.ros_from_imu),),
    "speed": (_typed("speed", parts.TWIST_STAMPED, sensors.ros_from_speed),),
    "heading": (_exact("heading", parts.IMU, sensors.ros_from_heading, sensors.heading_from_ros),),
    "steering": (
        _exact("steering", parts.JOINT_STATE, sensors.ros_from_steering, sensors.steering_from_ros),
        _Topic("steering_report", parts.STEERING_REPORT, sensors.steering_report),
    ),
    "control": (
        _Topic("control", parts.ACKERMANN, commands.ackermann_view),
        _json("control", "control_json"),
    ),
    "plan": (_Topic("plan", parts.TRAJECTORY, motion.trajectory_from_plan, plan_as_told),),
    "state": (
        _Topic("state", parts.ODOMETRY, motion.odometry_from_state),
        _json("state", "state_json"),
    ),
    "injection": (_Topic("injection", STRING, json_string),),  # of that drive: never said again
    "point_cloud": (_Topic("points", parts.POINT_CLOUD2, clouds.cloud_from),),
    "camera_image": (
        _Topic("camera/compressed", pictures.COMPRESSED_IMAGE, pictures.compressed_image_from),
        _Topic("camera/camera_info", pictures.CAMERA_INFO, pictures.camera_info_from),
    ),
    "sensed_gnss": (_Topic("sensed_gnss", parts.NAV_SAT_FIX, sensed.sensed_fix_from),),
    "sensed_imu": (_Topic("sensed_imu", parts.IMU, sensed.sensed_imu_from),),
    "radar_list": (_Topic("radar", parts.RADAR_SCAN, radars.radar_scan_from),),
}
"""What stands in a file by channel: a channel without a row of its own as JSON alone."""
_READ = {
    TOPIC_PREFIX + topic.name: (channel, topic)
    for channel, topics in _TOPICS.items()
    for topic in topics
    if topic.read is not None
}


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
    if channel not in _TOPICS:
        raise ValueError(f"channel {channel!r} is not written; known: {', '.join(_TOPICS)}")
    made = ((topic, topic.write(message, frame)) for topic in _TOPICS[channel])
    return [
        RosMessage(
            TOPIC_PREFIX + topic.name, topic.kind, bytes(typestore().serialize_cdr(ros, topic.kind))
        )
        for topic, ros in made
        if ros is not None
    ]


def kind_of(topic: str) -> str | None:
    """Return the type of one of our own topics that is read back, None for any other."""
    return _READ[topic][1].kind if topic in _READ else None


def channel_of(topic: str) -> str | None:
    """Return the channel of one of our own topics that is read back, None for any other."""
    return _READ[topic][0] if topic in _READ else None


def message_of(topic: str, ros: Any, frame: LocalFrame | None) -> tuple[str, msgspec.Struct]:
    """Return channel and message of a decoded message of a topic that has a `kind_of`."""
    channel, row = _READ[topic]
    assert row.read is not None
    (message,) = row.read(ros, stamp_of(ros), frame)
    return channel, message
