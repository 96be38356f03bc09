"""What messages of other programs' types mean: the channel each feeds, and how it is read.

Units and axes are as ROS says (REP-103, REP-105, REP-145): degrees on WGS84 of the antenna, m/s,
rad, body axes forward, left, up. Orientations are not read, since their zero is not certain, but
for poses in `map` where its place on Earth is known; without that, nothing in `map` is read.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.keys import CHANNELS, TELEMETRY_CHANNELS
from foretwin.telemetry.ros_messages import motion, objects, parts, status
from foretwin.telemetry.ros_messages.ackermann import AckermannTarget, target_from_ros
from foretwin.telemetry.ros_messages.odometry import ANOTHER_BODY, is_of_base

NO_FIX = "receiver without fix"
NO_TIMES = "plan without times"
ACCELERATION_UNDEFINED = "acceleration not defined"

Messages = tuple[msgspec.Struct, ...]


class UnusableError(ValueError):
    """A message that is in order but says nothing of use; the text is why, for counting."""


class Foreign(NamedTuple):
    """How messages of one type are read.

    Of the types and topics of one `stream` one is taken; a status has three streams, which
    `status.StatusJoiner` joins, and `ackermann.AckermannCommands` makes commands of targets. `read`
    takes the message, its stamp and the frame of
    `map`, None where unknown, returns samples of `channels` and raises UnusableError.
    """

    stream: str
    channels: tuple[str, ...]
    read: Callable[[Any, int, LocalFrame | None], Messages]


def stamp_of(ros: Any) -> int:
    """Return the stamp that a message carries, 0 where it carries none."""
    if hasattr(ros, "header"):
        return parts.stamp_ns_of(ros.header.stamp)
    return parts.stamp_ns_of(ros.stamp) if hasattr(ros, "stamp") else 0


def _sample(channel: str, read: Callable[[Any, int], msgspec.Struct], stream: str = "") -> Foreign:
    """Return how messages are read that hold one sample each, and need no frame."""
    return Foreign(stream or channel, (channel,), lambda ros, stamp_ns, _: (read(ros, stamp_ns),))


def _fix(ros: Any, stamp_ns: int) -> drive.GnssFix:
    if ros.status.status < 0:
        raise UnusableError(NO_FIX)
    variance = float(ros.position_covariance[0] + ros.position_covariance[4]) / 2.0
    # Drivers that know none say so by the type, or leave NaN, 0 or -1 where it would stand.
    known = ros.position_covariance_type != 0 and variance > 0.0
    # NavSatFix: "NaN if no altitude is available".
    alt_m = ros.altitude if ros.altitude == ros.altitude else 0.0
    position = GeoPoint(ros.latitude, ros.longitude, alt_m)
    std_m = variance**0.5 if known else None
    return drive.GnssFix(stamp_ns=stamp_ns, position=position, std_m=std_m)


def _imu(ros: Any, stamp_ns: int) -> drive.ImuSample:
    if ros.angular_velocity_covariance[0] == -1:
        raise UnusableError("imu without turning rates")
    accel, rate = ros.linear_acceleration, ros.angular_velocity
    felt = ros.linear_acceleration_covariance[0] != -1
    return drive.ImuSample(
        stamp_ns=stamp_ns,
        accel_mps2=(accel.x, accel.y, accel.z) if felt else (0.0, 0.0, 0.0),
        rate_radps=(rate.x, rate.y, rate.z),
    )


def _pose(ros: Any, stamp_ns: int, frame: LocalFrame | None) -> Messages:
    placed = _placed("odometry", frame)
    if not is_of_base(ros):
        raise UnusableError(ANOTHER_BODY)
    try:
        state = motion.state_from_odometry(ros, placed, vehicle_id="", stamp_ns=stamp_ns)
    except ValueError:
        raise UnusableError("odometry in another frame than map") from None
    return (
        drive.GnssFix(stamp_ns=stamp_ns, position=state.position, std_m=state.position_std_m),
        drive.HeadingSample(
            stamp_ns=stamp_ns, yaw_rad=state.yaw_rad, yaw_rate_radps=state.yaw_rate_radps
        ),
    )


def _speed_by(forward_mps: Callable[[Any], float]) -> Foreign:
    def read(ros: Any, stamp_ns: int) -> drive.SpeedSample:
        return drive.SpeedSample(stamp_ns=stamp_ns, speed_mps=float(forward_mps(ros)))

    return _sample("speed", read)


def _steering(ros: Any, stamp_ns: int) -> drive.SteeringSample:
    return drive.SteeringSample(stamp_ns=stamp_ns, tire_angle_rad=float(ros.steering_tire_angle))


def _control(ros: Any, stamp_ns: int) -> drive.ControlCommand:
    # Autoware's own controller fills in accelerations and leaves them undefined: only a 0 may be
    # one that nobody commanded.
    if not (ros.longitudinal.acceleration or _defines_acceleration(ros.longitudinal)):
        raise UnusableError(ACCELERATION_UNDEFINED)
    accel, angle = float(ros.longitudinal.acceleration), float(ros.lateral.steering_tire_angle)
    return drive.ControlCommand(stamp_ns=stamp_ns, accel_mps2=accel, tire_angle_rad=angle)


def _defines_acceleration(longitudinal: Any) -> bool:
    """Whether a Longitudinal says that its acceleration counts; older types say nothing of it."""
    return bool(getattr(longitudinal, "is_defined_acceleration", True))


def plan_as_told(ros: Any, _stamp_ns: int, frame: LocalFrame | None) -> Messages:
    """Return the plan of a Trajectory in `map` with its own times; raises UnusableError."""
    return (_plan_in_map(ros, _placed("plan", frame)),)


def _plan(ros: Any, _stamp_ns: int, frame: LocalFrame | None) -> Messages:
    placed = _placed("plan", frame)
    plan = _plan_in_map(ros, placed)
    try:
        return (motion.with_times(plan, placed),)
    except ValueError:
        raise UnusableError(NO_TIMES) from None


def _plan_in_map(ros: Any, placed: LocalFrame) -> drive.PlannedTrajectory:
    try:
        return motion.plan_from_trajectory(ros, placed)
    except ValueError:
        raise UnusableError("plan in another frame than map") from None


def _placed(what: str, frame: LocalFrame | None) -> LocalFrame:
    if frame is None:
        raise UnusableError(f"{what} in a frame whose origin is not known")
    return frame


def _users_by(convert: Callable[..., drive.RoadUsers]) -> Foreign:
    def read(ros: Any, stamp_ns: int, frame: LocalFrame | None) -> Messages:
        placed = _placed("objects", frame)
        try:
            return (convert(ros, placed, stamp_ns=stamp_ns),)
        except ValueError:
            raise UnusableError("objects in the car's own frame") from None

    return Foreign("objects", ("objects",), read)


def _signals(ros: Any, stamp_ns: int, _frame: LocalFrame | None) -> Messages:
    return status.signals_from_ros(ros, stamp_ns)


_VELOCITY = _speed_by(lambda ros: ros.longitudinal_velocity)
_STEERING = _sample("steering", _steering)
_CONTROL = _sample("control", _control)
_PLAN = Foreign("plan", ("plan",), _plan)

FOREIGN: dict[str, Foreign] = {
    parts.NAV_SAT_FIX: _sample("gnss", _fix),
    parts.IMU: _sample("imu", _imu),
    parts.VELOCITY_REPORT: _VELOCITY,
    "autoware_auto_vehicle_msgs/msg/VelocityReport": _VELOCITY,
    # A twist may be a receiver's, or commanded; odometry names the body that it is of.
    parts.ODOMETRY: _speed_by(lambda ros: ros.twist.twist.linear.x),
    parts.TWIST_STAMPED: _speed_by(lambda ros: ros.twist.linear.x),
    parts.TWIST_WITH_COVARIANCE_STAMPED: _speed_by(lambda ros: ros.twist.twist.linear.x),
    parts.STEERING_REPORT: _STEERING,
    "autoware_auto_vehicle_msgs/msg/SteeringReport": _STEERING,
    parts.CONTROL: _CONTROL,
    "autoware_auto_control_msgs/msg/AckermannControlCommand": _CONTROL,
    parts.ACKERMANN: _sample("control", target_from_ros),
    parts.TRAJECTORY: _PLAN,
    "autoware_auto_planning_msgs/msg/Trajectory": _PLAN,
    parts.CONTROL_MODE_REPORT: _sample("status", status.mode_from_ros, "status/mode"),
    parts.GEAR_REPORT: _sample("status", status.gear_from_ros, "status/gear"),
    parts.TURN_INDICATORS_REPORT: _sample("status", status.indicator_from_ros, "status/indicator"),
    # Predicted and tracked before detected: they have identities, and lie in `map`.
    parts.PREDICTED_OBJECTS: _users_by(objects.users_from_predicted),
    parts.TRACKED_OBJECTS: _users_by(objects.users_from_tracked),
    parts.DETECTED_OBJECTS: _users_by(objects.users_from_detected),
    parts.TRAFFIC_LIGHTS: Foreign("signals", ("signals",), _signals),
}
"""Types that are read, by full name; earlier ones win within a stream."""

POSE = Foreign("gnss", ("gnss", "heading"), _pose)
"""How an Odometry of base_link in `map` stands in for a receiver, where that frame is placed."""

_CHANNELS: dict[type, str] = {CHANNELS[name].kind: name for name in TELEMETRY_CHANNELS} | {
    AckermannTarget: "control",
    status.StatusPart: "status",
}


def channel_of(message: msgspec.Struct) -> str:
    """Return the channel of what a `Foreign` has read."""
    return _CHANNELS[type(message)]
