"""Road users as Autoware's DetectedObjects and PredictedObjects, and back.

Poses are box centres in the frame of the header: `map`, which a LocalFrame places on Earth, or
another one whose pose in `map` must be given. Twists are in the object's own axes. A detected
object has no identity: its id is its place in the message. Boxes have no height in ours: going
out it is usual for the kind, coming in it is dropped. Anything that one may drive over or under is
left out.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.frames import (
    GeoPoint,
    LocalFrame,
    geo_from_local,
    geo_from_local_yaw,
    local_from_geo,
    local_from_geo_yaw,
)
from foretwin.telemetry.ros_messages.parts import (
    DETECTED_OBJECTS,
    MAP_FRAME,
    PREDICTED_OBJECTS,
    covariance,
    header_from,
    point_from,
    ros_type,
    stamp_ns_of,
    turn_from,
    twist_from,
    vector_from,
    yaw_of,
)
from foretwin.telemetry.ros_messages.shapes import (
    classes_from,
    height_m,
    is_passable,
    kind_of,
    shape_from,
    size_m,
    uuid_from,
)

_HEADING_KNOWN = 2
"""DetectedObjectKinematics.orientation_availability: AVAILABLE."""


class PlanarPose(NamedTuple):
    """Pose of a frame in the local frame."""

    x_m: float
    y_m: float
    yaw_rad: float


class _Box(NamedTuple):
    user_id: str
    classes: Any
    pose: Any
    twist: Any
    shape: Any


def users_from_detected(
    ros: Any,
    frame: LocalFrame,
    *,
    stamp_ns: int | None = None,
    header_frame: PlanarPose | None = None,
) -> drive.RoadUsers:
    """Return the road users of a DetectedObjects.

    `frame` is the plane of `map`; `header_frame` the pose in it of the header's frame where that is
    another. `stamp_ns` replaces the header's. Raises ValueError where the pose is missing.
    """
    boxes = [
        _Box(
            str(place),
            one.classification,
            one.kinematics.pose_with_covariance.pose,
            one.kinematics.twist_with_covariance.twist,
            one.shape,
        )
        for place, one in enumerate(ros.objects)
    ]
    return _users(ros.header, boxes, frame, stamp_ns, header_frame)


def users_from_predicted(
    ros: Any,
    frame: LocalFrame,
    *,
    stamp_ns: int | None = None,
    header_frame: PlanarPose | None = None,
) -> drive.RoadUsers:
    """Return the road users of a PredictedObjects as they are now; see users_from_detected."""
    boxes = [
        _Box(
            bytes(one.object_id.uuid).hex(),
            one.classification,
            one.kinematics.initial_pose_with_covariance.pose,
            one.kinematics.initial_twist_with_covariance.twist,
            one.shape,
        )
        for one in ros.objects
    ]
    return _users(ros.header, boxes, frame, stamp_ns, header_frame)


def detected_from_users(message: drive.RoadUsers, frame: LocalFrame) -> Any:
    """Return the DetectedObjects of road users in the frame `map`."""
    kinematics = ros_type("autoware_perception_msgs/msg/DetectedObjectKinematics")
    detected = ros_type("autoware_perception_msgs/msg/DetectedObject")
    objects = [
        detected(
            existence_probability=1.0,
            classification=classes_from(user),
            kinematics=kinematics(
                pose_with_covariance=_pose(user, _planar(user, frame), frame),
                has_position_covariance=False,
                orientation_availability=_HEADING_KNOWN,
                twist_with_covariance=_twist(user),
                has_twist=True,
                has_twist_covariance=False,
            ),
            shape=shape_from(user),
        )
        for user in message.users
    ]
    return ros_type(DETECTED_OBJECTS)(
        header=header_from(message.stamp_ns, MAP_FRAME), objects=objects
    )


def predicted_from_users(
    message: drive.RoadUsers, frame: LocalFrame, *, horizon_s: float = 8.0, step_s: float = 0.5
) -> Any:
    """Return the PredictedObjects of road users in `map`, each going straight on at its speed."""
    kinematics = ros_type("autoware_perception_msgs/msg/PredictedObjectKinematics")
    predicted = ros_type("autoware_perception_msgs/msg/PredictedObject")
    still = ros_type("geometry_msgs/msg/AccelWithCovariance")(
        accel=ros_type("geometry_msgs/msg/Accel")(
            linear=vector_from(0.0, 0.0, 0.0), angular=vector_from(0.0, 0.0, 0.0)
        ),
        covariance=covariance(6),
    )
    objects = []
    for user in message.users:
        now = _planar(user, frame)
        objects.append(
            predicted(
                object_id=uuid_from(user.user_id),
                existence_probability=1.0,
                classification=classes_from(user),
                kinematics=kinematics(
                    initial_pose_with_covariance=_pose(user, now, frame),
                    initial_twist_with_covariance=_twist(user),
                    initial_acceleration_with_covariance=still,
                    predicted_paths=[_straight_on(user, now, frame, horizon_s, step_s)],
                ),
                shape=shape_from(user),
            )
        )
    return ros_type(PREDICTED_OBJECTS)(
        header=header_from(message.stamp_ns, MAP_FRAME), objects=objects
    )


def _users(
    header: Any,
    boxes: list[_Box],
    frame: LocalFrame,
    stamp_ns: int | None,
    header_frame: PlanarPose | None,
) -> drive.RoadUsers:
    if header_frame is None:
        if header.frame_id.lstrip("/") != MAP_FRAME:
            raise ValueError(f"objects in frame {header.frame_id!r}, whose pose is not known")
        header_frame = PlanarPose(0.0, 0.0, 0.0)
    users = tuple(_user(box, frame, header_frame) for box in boxes if not is_passable(box.classes))
    return drive.RoadUsers(
        stamp_ns=stamp_ns_of(header.stamp) if stamp_ns is None else stamp_ns, users=users
    )


def _user(box: _Box, frame: LocalFrame, at: PlanarPose) -> drive.RoadUser:
    cos, sin = math.cos(at.yaw_rad), math.sin(at.yaw_rad)
    place, shape = box.pose.position, box.shape
    xy_m = np.array(
        [[at.x_m + cos * place.x - sin * place.y, at.y_m + sin * place.x + cos * place.y]]
    )
    yaw = geo_from_local_yaw(frame, np.array([at.yaw_rad + yaw_of(box.pose.orientation)]), xy_m)
    length_m, width_m = size_m(shape)
    geo = geo_from_local(frame, xy_m)[0]
    return drive.RoadUser(
        user_id=box.user_id,
        kind=kind_of(box.classes),
        position=GeoPoint(
            float(geo[0]), float(geo[1]), frame.origin.alt_m + place.z - 0.5 * shape.dimensions.z
        ),
        yaw_rad=float(yaw[0]),
        speed_mps=float(box.twist.linear.x),
        length_m=length_m,
        width_m=width_m,
    )


def _planar(user: drive.RoadUser, frame: LocalFrame) -> PlanarPose:
    lat, lon = user.position.lat_deg, user.position.lon_deg
    x_m, y_m = local_from_geo(frame, lat, lon).tolist()
    return PlanarPose(x_m, y_m, float(local_from_geo_yaw(frame, user.yaw_rad, lat, lon)))


def _ros_pose(at: PlanarPose, z_m: float) -> Any:
    return ros_type("geometry_msgs/msg/Pose")(
        position=point_from(at.x_m, at.y_m, z_m), orientation=turn_from(at.yaw_rad)
    )


def _z_m(user: drive.RoadUser, frame: LocalFrame) -> float:
    return user.position.alt_m - frame.origin.alt_m + 0.5 * height_m(user)


def _pose(user: drive.RoadUser, at: PlanarPose, frame: LocalFrame) -> Any:
    return ros_type("geometry_msgs/msg/PoseWithCovariance")(
        pose=_ros_pose(at, _z_m(user, frame)), covariance=covariance(6)
    )


def _twist(user: drive.RoadUser) -> Any:
    return ros_type("geometry_msgs/msg/TwistWithCovariance")(
        twist=twist_from(user.speed_mps, 0.0), covariance=covariance(6)
    )


def _straight_on(
    user: drive.RoadUser, now: PlanarPose, frame: LocalFrame, horizon_s: float, step_s: float
) -> Any:
    ahead_m = user.speed_mps * step_s * np.arange(math.floor(horizon_s / step_s + 1e-9) + 1)
    cos, sin = math.cos(now.yaw_rad), math.sin(now.yaw_rad)
    z_m = _z_m(user, frame)
    step_ns = round(step_s * 1e9)
    return ros_type("autoware_perception_msgs/msg/PredictedPath")(
        path=[
            _ros_pose(PlanarPose(now.x_m + way * cos, now.y_m + way * sin, now.yaw_rad), z_m)
            for way in ahead_m.tolist()
        ],
        time_step=ros_type("builtin_interfaces/msg/Duration")(
            sec=step_ns // 10**9, nanosec=step_ns % 10**9
        ),
        confidence=1.0,
    )
