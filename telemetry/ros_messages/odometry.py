"""Which body an Odometry is of, and the same Odometry of base_link where transforms tell how."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.ros_messages.parts import BASE_FRAME
from foretwin.telemetry.ros_messages.transforms import TransformTree, matrix_of

ANOTHER_BODY = "odometry of another body than base_link, and no transform tells its place"
_BASES = (BASE_FRAME, "base_footprint")
"""REP-105 and REP-120: the second is the first's projection onto the ground."""


def is_of_base(ros: Any) -> bool:
    """Whether an Odometry is of base_link."""
    return str(ros.child_frame_id).lstrip("/") in _BASES


def of_base(ros: Any, tree: TransformTree) -> Any:
    """Return an Odometry as base_link's, moved by the static transforms; as it is without any.

    Of its orientation the yaw is kept. Its covariances stay, since the bodies are rigidly joined.
    """
    if is_of_base(ros):
        return ros
    base_from_body = tree.within_from(str(ros.child_frame_id), BASE_FRAME)
    if base_from_body is None:
        return ros
    pose, twist = ros.pose.pose, ros.twist.twist
    frame_from_base = matrix_of(pose.orientation, pose.position) @ np.linalg.inv(base_from_body)
    turn, place_m = base_from_body[:3, :3], base_from_body[:3, 3]
    rate_radps = turn @ _vector(twist.angular)
    # base_link lies at -place_m from the body, and goes round it as both turn.
    speed_mps = turn @ _vector(twist.linear) - np.cross(rate_radps, place_m)
    half_rad = 0.5 * math.atan2(frame_from_base[1, 0], frame_from_base[0, 0])
    turned = dataclasses.replace(
        pose.orientation, x=0.0, y=0.0, z=math.sin(half_rad), w=math.cos(half_rad)
    )
    return dataclasses.replace(
        ros,
        child_frame_id=BASE_FRAME,
        pose=dataclasses.replace(
            ros.pose,
            pose=dataclasses.replace(
                pose, position=_replaced(pose.position, frame_from_base[:3, 3]), orientation=turned
            ),
        ),
        twist=dataclasses.replace(
            ros.twist,
            twist=dataclasses.replace(
                twist,
                linear=_replaced(twist.linear, speed_mps),
                angular=_replaced(twist.angular, rate_radps),
            ),
        ),
    )


def _vector(ros: Any) -> Array:
    return np.array([ros.x, ros.y, ros.z])


def _replaced(ros: Any, numbers: Array) -> Any:
    x, y, z = numbers.tolist()
    return dataclasses.replace(ros, x=x, y=y, z=z)
