"""Road users as Autoware's DetectedObjects and PredictedObjects, and back.

Poses are box centres in the frame `map`, which a LocalFrame places on Earth. Twists are in the
object's own axes. A detected object has no identity: its id is its place in the message. Boxes have
no height in ours: going out it is usual for the kind, coming in it is dropped. Anything that one
may drive over or under is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts import drive, frames
from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.ros_messages import parts, shapes
from foretwin.telemetry.ros_messages.parts import MAP_FRAME, ros_message

_HEADING_KNOWN = 2
"""DetectedObjectKinematics.orientation_availability: AVAILABLE."""
_HORIZON_S, _STEP_S = 8.0, 0.5
"""Of predicted paths, as Autoware's own prediction has them."""


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


def users_from_predicted(ros: Any, frame: LocalFrame, *, stamp_ns: int) -> drive.RoadUsers:
    """Return the road users of a PredictedObjects as they are now; see users_from_detected."""
    boxes = (
        _Box(
            bytes(one.object_id.uuid).hex(),
            one.kinematics.initial_pose_with_covariance.pose,
            one.kinematics.initial_twist_with_covariance.twist,
        )
        for one in ros.objects
    )
    return _users(ros, boxes, frame, stamp_ns)


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
    place = box.pose.position
    alt_m = frame.origin.alt_m + place.z - 0.5 * one.shape.dimensions.z
    at = frames.geo_pose(frame, place.x, place.y, parts.yaw_of(box.pose.orientation), alt_m=alt_m)
    length_m, width_m = shapes.size_m(one.shape)
    return drive.RoadUser(
        user_id=box.user_id,
        kind=shapes.kind_of(one.classification),
        position=at.position,
        yaw_rad=at.yaw_rad,
        speed_mps=float(box.twist.linear.x),
        length_m=length_m,
        width_m=width_m,
    )


def detected_from_users(message: drive.RoadUsers, frame: LocalFrame) -> Any:
    """Return the DetectedObjects of road users in the frame `map`."""
    objects = []
    for user in message.users:
        (now,) = _poses(user, frame, np.zeros(1))
        kinematics = ros_message(
            "autoware_perception_msgs/msg/DetectedObjectKinematics",
            pose_with_covariance=_certain("Pose", now),
            orientation_availability=_HEADING_KNOWN,
            twist_with_covariance=_certain("Twist", parts.twist_from(user.speed_mps, 0.0)),
            has_twist=True,
        )
        kind = "autoware_perception_msgs/msg/DetectedObject"
        objects.append(ros_message(kind, kinematics=kinematics, **_seen(user)))
    header = parts.header_from(message.stamp_ns, MAP_FRAME)
    return ros_message(parts.DETECTED_OBJECTS, header=header, objects=objects)


def predicted_from_users(message: drive.RoadUsers, frame: LocalFrame) -> Any:
    """Return the PredictedObjects of road users in `map`, each going straight on at its speed."""
    objects = []
    for user in message.users:
        path = _poses(user, frame, np.arange(0.0, _HORIZON_S + _STEP_S, _STEP_S))
        kinematics = ros_message(
            "autoware_perception_msgs/msg/PredictedObjectKinematics",
            initial_pose_with_covariance=_certain("Pose", path[0]),
            initial_twist_with_covariance=_certain("Twist", parts.twist_from(user.speed_mps, 0.0)),
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


def _seen(user: drive.RoadUser) -> dict[str, Any]:
    """Return the fields that detected and predicted objects share."""
    return {
        "existence_probability": 1.0,
        "classification": shapes.classes_from(user),
        "shape": shapes.shape_from(user),
    }


def _certain(name: str, value: Any) -> Any:
    """Return a PoseWithCovariance or TwistWithCovariance whose covariance is zero."""
    return ros_message(f"geometry_msgs/msg/{name}WithCovariance", **{name.lower(): value})


def _poses(user: drive.RoadUser, frame: LocalFrame, after_s: Array) -> list[Any]:
    """Return the poses of a road user after so many seconds (N,), straight on at its speed."""
    x_m, y_m, yaw_rad = frames.local_pose(frame, user.position, user.yaw_rad)
    z_m = user.position.alt_m - frame.origin.alt_m + 0.5 * shapes.height_m(user)
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return [
        parts.pose_from(x_m + way_m * cos, y_m + way_m * sin, z_m, yaw_rad)
        for way_m in (user.speed_mps * after_s).tolist()
    ]
