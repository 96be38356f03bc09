"""Reader of MCAP files with ROS 2 messages that other programs wrote.

Topics are chosen by message type, one topic per channel: the first type of `_FOREIGN` that occurs,
and among its topics the one with the most messages. Declares, as ROS 2 does (REP-103, REP-105,
REP-145): degrees on WGS84 of the antenna, m/s, rad, body axes forward, left, up; the stamp of the
header, and the log time where that is 0. A planned trajectory is read only where metadata
`foretwin.frame` tells the origin of its frame; orientations are not read, since their zero is not
certain.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from contracts import drive
from contracts.frames import GeoPoint, LocalFrame
from telemetry.logs.log import FILE_CUT_SHORT, UNREADABLE_ROW, Declared, Log, LogError, Sample
from telemetry.logs.mcap_records import Contents, Record, records
from telemetry.logs.merge import reordered
from telemetry.ros_motion import plan_from_trajectory
from telemetry.ros_parts import stamp_ns_of

NO_FIX = "receiver without fix"
WINDOW_NS = 2_000_000_000
"""How late a message may lie in its file and still be put in order."""
_UTC_FROM_NS = 946_684_800_000_000_000
"""2000-01-01: clocks beyond it count from 1970, others from boot or start."""


class _Kind(NamedTuple):
    """How messages of one foreign type are read; None where a message holds no sample."""

    channel: str
    read: Callable[[Any, int, LocalFrame | None], msgspec.Struct | None]


def _fix(ros: Any, stamp_ns: int, _frame: LocalFrame | None) -> drive.GnssFix | None:
    if ros.status.status < 0:
        return None
    known = ros.position_covariance_type != 0
    variance = max(float(ros.position_covariance[0] + ros.position_covariance[4]) / 2.0, 0.0)
    return drive.GnssFix(
        stamp_ns=stamp_ns,
        position=GeoPoint(ros.latitude, ros.longitude, _altitude(ros.altitude)),
        std_m=variance**0.5 if known else None,
    )


def _altitude(alt_m: float) -> float:
    # NavSatFix: "NaN if no altitude is available".
    return alt_m if alt_m == alt_m else 0.0


def _imu(ros: Any, stamp_ns: int, _frame: LocalFrame | None) -> drive.ImuSample | None:
    if ros.angular_velocity_covariance[0] == -1 or ros.linear_acceleration_covariance[0] == -1:
        return None
    accel, rate = ros.linear_acceleration, ros.angular_velocity
    return drive.ImuSample(
        stamp_ns=stamp_ns,
        accel_mps2=(accel.x, accel.y, accel.z),
        rate_radps=(rate.x, rate.y, rate.z),
    )


def _speed_by(forward_mps: Callable[[Any], float]) -> _Kind:
    return _Kind(
        "speed",
        lambda ros, stamp_ns, _: drive.SpeedSample(
            stamp_ns=stamp_ns, speed_mps=float(forward_mps(ros))
        ),
    )


_STEERING = _Kind(
    "steering",
    lambda ros, stamp_ns, _: drive.SteeringSample(
        stamp_ns=stamp_ns, tire_angle_rad=float(ros.steering_tire_angle)
    ),
)
_CONTROL = _Kind(
    "control",
    lambda ros, stamp_ns, _: drive.ControlCommand(
        stamp_ns=stamp_ns,
        accel_mps2=float(ros.longitudinal.acceleration),
        tire_angle_rad=float(ros.lateral.steering_tire_angle),
    ),
)
_ACKERMANN = _Kind(
    "control",
    lambda ros, stamp_ns, _: drive.ControlCommand(
        stamp_ns=stamp_ns,
        accel_mps2=float(ros.drive.acceleration),
        tire_angle_rad=float(ros.drive.steering_angle),
    ),
)


def _plan(ros: Any, _stamp_ns: int, frame: LocalFrame | None) -> drive.PlannedTrajectory | None:
    return None if frame is None else plan_from_trajectory(ros, frame)


_FOREIGN: dict[str, _Kind] = {
    "sensor_msgs/msg/NavSatFix": _Kind("gnss", _fix),
    "sensor_msgs/msg/Imu": _Kind("imu", _imu),
    "autoware_vehicle_msgs/msg/VelocityReport": _speed_by(lambda ros: ros.longitudinal_velocity),
    "autoware_auto_vehicle_msgs/msg/VelocityReport": _speed_by(
        lambda ros: ros.longitudinal_velocity
    ),
    "geometry_msgs/msg/TwistStamped": _speed_by(lambda ros: ros.twist.linear.x),
    "geometry_msgs/msg/TwistWithCovarianceStamped": _speed_by(lambda ros: ros.twist.twist.linear.x),
    "nav_msgs/msg/Odometry": _speed_by(lambda ros: ros.twist.twist.linear.x),
    "autoware_vehicle_msgs/msg/SteeringReport": _STEERING,
    "autoware_auto_vehicle_msgs/msg/SteeringReport": _STEERING,
    "autoware_control_msgs/msg/Control": _CONTROL,
    "autoware_auto_control_msgs/msg/AckermannControlCommand": _CONTROL,
    "ackermann_msgs/msg/AckermannDriveStamped": _ACKERMANN,
    "autoware_planning_msgs/msg/Trajectory": _Kind("plan", _plan),
    "autoware_auto_planning_msgs/msg/Trajectory": _Kind("plan", _plan),
}
"""Types that are read of other programs' files; earlier ones win within a channel."""


def open_foreign(path: Path, contents: Contents, frame: LocalFrame | None) -> Log:
    """Open a file of another program; `frame` is the frame of its plans, None where unknown.

    Raises LogError where it holds no positions, or definitions that cannot be read.
    """
    topics = _choose_topics(contents)
    if "gnss" not in topics:
        kinds = sorted({schema.name for schema in contents.schemas.values()})
        raise LogError(
            f"{path}: no topic of type sensor_msgs/msg/NavSatFix, so no positions;"
            f" types: {', '.join(kinds) or 'none'}"
        )
    decode = _decoder(path, contents, set(topics.values()))

    def read(skipped: Counter[str]) -> Iterator[Sample]:
        if contents.cut_short:
            skipped[FILE_CUT_SHORT] += 1
        chosen = set(topics.values())
        samples = _foreign_samples(path, contents, chosen, decode, frame, skipped)
        return reordered(samples, window_ns=WINDOW_NS)

    # Header stamps differ from log times by the transport's delay, and at times by a whole epoch.
    lag_ns = _first_lag_ns(path, contents, topics["gnss"], decode)
    start_ns = contents.first_ns - lag_ns
    return Log(
        info=drive.VehicleInfo(
            vehicle_id="car",
            time_base=time_base_of(start_ns),
            start_stamp_ns=start_ns,
            end_stamp_ns=contents.last_ns - lag_ns,
            source=path.name,
            reference_point="antenna",
            sends=tuple(topics),
        ),
        declared=Declared(
            units="degrees, m/s, rad, m/s²; "
            + ", ".join(f"{channel} from {topic}" for channel, topic in topics.items()),
            frame="WGS84, body axes forward, left, up",
            time_base="stamp of the header, log time where it is 0",
            reference_point="antenna, place unknown",
        ),
        read=read,
    )


def _choose_topics(contents: Contents) -> dict[str, str]:
    chosen: dict[str, str] = {}
    for kind, how in _FOREIGN.items():
        topics = [
            topic
            for topic, schema in contents.schemas.items()
            if schema.name == kind and contents.counts.get(topic, 0) > 0
        ]
        if topics and how.channel not in chosen:
            chosen[how.channel] = max(topics, key=lambda topic: (contents.counts[topic], topic))
    return chosen


def _decoder(path: Path, contents: Contents, topics: set[str]) -> Callable[[Record], Any]:
    """Return a decoder by the definitions in the file itself."""
    types: Typesdict = {}
    for topic in topics:
        schema = contents.schemas[topic]
        text = schema.data.decode("utf-8", errors="replace")
        try:
            if schema.encoding == "ros2msg":
                types.update(get_types_from_msg(text, schema.name))
            elif schema.encoding == "ros2idl":
                types.update(get_types_from_idl(text))
            else:
                raise LogError(
                    f"{path}: topic {topic}: schema encoding {schema.encoding!r};"
                    " readable: ros2msg, ros2idl"
                )
        except LogError:
            raise
        except Exception as error:  # rosbags raises many kinds over texts it cannot parse
            raise LogError(f"{path}: topic {topic}: unreadable definition: {error}") from None
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return lambda record: store.deserialize_cdr(record.data, record.kind)


def _stamp_of(ros: Any, record: Record) -> int:
    time = ros.header.stamp if hasattr(ros, "header") else getattr(ros, "stamp", None)
    stamp_ns = 0 if time is None else stamp_ns_of(time)
    return stamp_ns or record.log_time_ns


def _first_lag_ns(
    path: Path, contents: Contents, topic: str, decode: Callable[[Record], Any]
) -> int:
    for record in records(path, contents, {topic}):
        try:
            return record.log_time_ns - _stamp_of(decode(record), record)
        except Exception:  # an unreadable message, counted when it is read
            continue
    return 0


def _foreign_samples(
    path: Path,
    contents: Contents,
    topics: set[str],
    decode: Callable[[Record], Any],
    frame: LocalFrame | None,
    skipped: Counter[str],
) -> Iterator[Sample]:
    for record in records(path, contents, topics):
        how = _FOREIGN[record.kind]
        try:
            ros = decode(record)
            message = how.read(ros, _stamp_of(ros, record), frame)
        except Exception:  # whatever rosbags raises over broken bytes
            skipped[UNREADABLE_ROW] += 1
            continue
        if message is None:
            skipped[NO_FIX if how.channel == "gnss" else f"{how.channel} without values"] += 1
        else:
            yield how.channel, message


def time_base_of(stamp_ns: int) -> drive.TimeBase:
    """Guess the time base from one stamp."""
    return "utc" if stamp_ns > _UTC_FROM_NS else "log"
