"""Road users as Autoware's DetectedObjects, TrackedObjects and PredictedObjects, and back.

Poses are box centres in the frame `map`, which a LocalFrame places on Earth. Twists are in the
object's own axes: who goes sideways there, of whom perception knows no heading, comes in as a box
along its way. A detected object has no identity: its id is its place in the message. Boxes have no
height in ours: going out it is usual for the kind, coming in it is dropped. Anything that one may
drive over or under is left out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts import drive, frames
from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.ros_messages import parts, shapes
from foretwin.telemetry.ros_messages.parts import MAP_FRAME, ros_message

_HEADING_KNOWN = 2
"""orientation_availability of DetectedObjectKinematics and TrackedObjectKinematics: AVAILABLE."""
_STANDS_MPS = 0.1
"""Slower than this a tracked object is told to stand; chosen."""
_SIDEWAYS_MPS, _SIDEWAYS = 0.5, 0.3
"""Who goes to its side faster than so, and than this share of its speed ahead, does not drive where
it points; vehicles slip by less. Chosen."""
_HORIZON_S, _STEP_S = 8.0, 0.5
"""Of predicted paths, as Autoware's own prediction has them."""


class ObjectSpread(NamedTuple):
    """How sure the sender is: standard deviations, 0 where it knows."""

    position_m: float = 0.0
    yaw_rad: float = 0.0
    speed_mps: float = 0.0


CERTAIN = ObjectSpread()


class _Box(NamedTuple):
    user_id: str
    pose: Any
    twist: Any


def users_from_detected(ros: Any, frame: LocalFrame, *, stamp_ns: int) -> drive.RoadUsers:
    """Return the road users of a DetectedObjects.

    `frame` is the plane of `map`. Raises ValueError for objects in another frame.
    """
    kinematics = (one.kinematics for one in ros.objects)
    boxes = (
        _Box(str(place), one.pose_with_covariance.pose, one.twist_with_covariance.twist)
        for place, one in enumerate(kinematics)
    )
    return _users(ros, boxes, frame, stamp_ns)


def users_from_tracked(ros: Any, frame: LocalFrame, *, stamp_ns: int) -> drive.RoadUsers:
    """Return the road users of a TrackedObjects; see users_from_detected."""
    return _users(ros, _known(ros, ""), frame, stamp_ns)


def users_from_predicted(ros: Any, frame: LocalFrame, *, stamp_ns: int) -> drive.RoadUsers:
    """Return the road users of a PredictedObjects as they are now; see users_from_detected."""
    return _users(ros, _known(ros, "initial_"), frame, stamp_ns)


def _known(ros: Any, when: str) -> Iterator[_Box]:
    """Yield the boxes of objects that have an identity, from fields that begin with `when`."""
    for one in ros.objects:
        pose = getattr(one.kinematics, f"{when}pose_with_covariance").pose
        twist = getattr(one.kinematics, f"{when}twist_with_covariance").twist
        yield _Box(bytes(one.object_id.uuid).hex(), pose, twist)


def _users(ros: Any, boxes: Iterable[_Box], frame: LocalFrame, stamp_ns: int) -> drive.RoadUsers:
    if ros.header.frame_id.lstrip("/") != MAP_FRAME:
        raise ValueError(f"objects in frame {ros.header.frame_id!r}, whose pose is not known")
    users = tuple(
        _user(box, one, frame)
        for box, one in zip(boxes, ros.objects, strict=True)
        if not shapes.is_passable(one.classification)
    )
    return drive.RoadUsers(stamp_ns=stamp_ns, users=users)


def _user(box: _Box, one: Any, frame: LocalFrame) -> drive.RoadUser:
    place, ahead_mps, left_mps = box.pose.position, box.twist.linear.x, box.twist.linear.y
    speed_mps, turned_rad = float(ahead_mps), 0.0
    if abs(left_mps) > max(_SIDEWAYS_MPS, _SIDEWAYS * abs(ahead_mps)):
        # Which way it points is not known, but which way it goes: that is its yaw here.
        speed_mps, turned_rad = math.hypot(ahead_mps, left_mps), math.atan2(left_mps, ahead_mps)
    yaw_rad = parts.yaw_of(box.pose.orientation) + turned_rad
    outline = shapes.outline_of(one.shape, turned_rad=turned_rad)
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    at = frames.geo_pose(
        frame,
        place.x + cos * outline.ahead_m - sin * outline.left_m,
        place.y + sin * outline.ahead_m + cos * outline.left_m,
        yaw_rad,
        alt_m=frame.origin.alt_m + place.z - 0.5 * one.shape.dimensions.z,
    )
    return drive.RoadUser(
        user_id=box.user_id,
        kind=shapes.kind_of(one.classification),
        position=at.position,
        yaw_rad=at.yaw_rad,
        speed_mps=speed_mps,
        length_m=outline.length_m,
        width_m=outline.width_m,
    )


def detected_from_users(
    message: drive.RoadUsers, frame: LocalFrame, spread: ObjectSpread = CERTAIN
) -> Any:
    """Return the DetectedObjects of road users in the frame `map`."""
    objects = []
    for user in message.users:
        (now,) = _poses(user, frame, np.zeros(1))
        kinematics = ros_message(
            "autoware_perception_msgs/msg/DetectedObjectKinematics",
            pose_with_covariance=_pose(now, spread),
            has_position_covariance=spread.position_m > 0.0,
            orientation_availability=_HEADING_KNOWN,
            twist_with_covariance=_twist(user, spread),
            has_twist=True,
            has_twist_covariance=spread.speed_mps > 0.0,
        )
        kind = "autoware_perception_msgs/msg/DetectedObject"
        objects.append(ros_message(kind, kinematics=kinematics, **_seen(user)))
    header = parts.header_from(message.stamp_ns, MAP_FRAME)
    return ros_message(parts.DETECTED_OBJECTS, header=header, objects=objects)


def tracked_from_users(
    message: drive.RoadUsers, frame: LocalFrame, spread: ObjectSpread = CERTAIN
) -> Any:
    """Return the TrackedObjects of road users in the frame `map`."""
    objects = []
    for user in message.users:
        (now,) = _poses(user, frame, np.zeros(1))
        kinematics = ros_message(
            "autoware_perception_msgs/msg/TrackedObjectKinematics",
            pose_with_covariance=_pose(now, spread),
            orientation_availability=_HEADING_KNOWN,
            twist_with_covariance=_twist(user, spread),
            is_stationary=abs(user.speed_mps) < _STANDS_MPS,
        )
        kind, object_id = "autoware_perception_msgs/msg/TrackedObject", shapes.uuid_from(user)
        objects.append(ros_message(kind, object_id=object_id, kinematics=kinematics, **_seen(user)))
    header = parts.header_from(message.stamp_ns, MAP_FRAME)
    return ros_message(parts.TRACKED_OBJECTS, header=header, objects=objects)


def predicted_from_users(
    message: drive.RoadUsers, frame: LocalFrame, spread: ObjectSpread = CERTAIN
) -> Any:
    """Return the PredictedObjects of road users in `map`, each going straight on at its speed."""
    objects = []
    for user in message.users:
        path = _poses(user, frame, np.arange(0.0, _HORIZON_S + _STEP_S, _STEP_S))
        kinematics = ros_message(
            "autoware_perception_msgs/msg/PredictedObjectKinematics",
            initial_pose_with_covariance=_pose(path[0], spread),
            initial_twist_with_covariance=_twist(user, spread),
            predicted_paths=[
                ros_message(
                    "autoware_perception_msgs/msg/PredictedPath",
                    path=path,
                    time_step=parts.duration_from(round(_STEP_S * 1e9)),
                    confidence=1.0,
                )
            ],
        )
        kind, object_id = "autoware_perception_msgs/msg/PredictedObject", shapes.uuid_from(user)
        objects.append(ros_message(kind, object_id=object_id, kinematics=kinematics, **_seen(user)))
    header = parts.header_from(message.stamp_ns, MAP_FRAME)
    return ros_message(parts.PREDICTED_OBJECTS, header=header, objects=objects)


FROM_USERS: dict[str, Callable[[drive.RoadUsers, LocalFrame, ObjectSpread], Any]] = {
    parts.DETECTED_OBJECTS: detected_from_users,
    parts.TRACKED_OBJECTS: tracked_from_users,
    parts.PREDICTED_OBJECTS: predicted_from_users,
}
"""How road users go out as each type."""


def joined(ros: Any, ours: Any, *, without: Collection[str]) -> Any:
    """Return one list of objects as they came and of ours, with the header of those that came.

    `without` are ids of those left out: a UUID's 32 digits, else the place in the message. All
    else that was said of an object that came, such as its predicted paths, stays as it was.
    """
    kept = [
        one
        for place, one in enumerate(ros.objects)
        if (bytes(one.object_id.uuid).hex() if hasattr(one, "object_id") else str(place))
        not in without
    ]
    return dataclasses.replace(ros, objects=[*kept, *ours.objects])


def _seen(user: drive.RoadUser) -> dict[str, Any]:
    """Return the fields that detected and predicted objects share."""
    return {
        "existence_probability": 1.0,
        "classification": shapes.classes_from(user),
        "shape": shapes.shape_from(user),
    }


def _pose(pose: Any, spread: ObjectSpread) -> Any:
    place, turn = spread.position_m**2, spread.yaw_rad**2
    covariance = parts.covariance(6, d0=place, d1=place, d5=turn)
    kind = "geometry_msgs/msg/PoseWithCovariance"
    return ros_message(kind, pose=pose, covariance=covariance)


def _twist(user: drive.RoadUser, spread: ObjectSpread) -> Any:
    twist = parts.twist_from(user.speed_mps, 0.0)
    covariance = parts.covariance(6, d0=spread.speed_mps**2)
    kind = "geometry_msgs/msg/TwistWithCovariance"
    return ros_message(kind, twist=twist, covariance=covariance)


def _poses(user: drive.RoadUser, frame: LocalFrame, after_s: Array) -> list[Any]:
    """Return the poses of a road user after so many seconds (N,), straight on at its speed."""
    x_m, y_m, yaw_rad = frames.local_pose(frame, user.position, user.yaw_rad)
    z_m = user.position.alt_m - frame.origin.alt_m + 0.5 * shapes.height_m(user)
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return [
        parts.pose_from(x_m + way_m * cos, y_m + way_m * sin, z_m, yaw_rad)
        for way_m in (user.speed_mps * after_s).tolist()
    ]
