"""Kind, size and identity of road users as Autoware's classification, shape and UUID."""

from __future__ import annotations

import math
import uuid
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.road_user_heights import HEIGHT_M
from foretwin.telemetry.ros_messages.parts import ros_message, vector_from, within_float32

_TRAILER = 4
_LABEL_BY_KIND: dict[drive.RoadUserKind, int] = {
    # Autoware knows no vans and no trams: what plans around a tram must leave a bus's room.
    "van": 1,
    "tram": 3,
    "unknown": 0,
    "car": 1,
    "lorry": 2,
    "bus": 3,
    "motorcycle": 5,
    "bicycle": 6,
    "pedestrian": 7,
}
"""ObjectClassification.label; what comes in with another one is unknown."""
_KIND_BY_LABEL: dict[int, drive.RoadUserKind] = {
    **{label: kind for kind, label in _LABEL_BY_KIND.items()},
    _TRAILER: "lorry",
}
_PASSABLE = (10, 11)
"""OVER_DRIVABLE, UNDER_DRIVABLE."""
_BOX, _CYLINDER, _POLYGON = 0, 1, 2
_IDS = uuid.UUID("6f2d1c1e-2f0a-5c39-9d5b-1f5f0c7a3b11")
"""Namespace of the UUIDs of ids that are none."""


def is_passable(classes: Any) -> bool:
    """Tell whether one may drive over or under what is classified so."""
    return _label(classes) in _PASSABLE


def kind_of(classes: Any) -> drive.RoadUserKind:
    """Return the kind of an array of ObjectClassification."""
    return _KIND_BY_LABEL.get(_label(classes), "unknown")


def _label(classes: Any) -> int:
    return int(max(classes, key=lambda one: one.probability).label) if len(classes) else 0


class Outline(NamedTuple):
    """A box: its size, and where its middle is from the object's pose, ahead and to the left."""

    length_m: float
    width_m: float
    ahead_m: float = 0.0
    left_m: float = 0.0


def outline_of(shape: Any, *, turned_rad: float = 0.0) -> Outline:
    """Return the box around a Shape, in axes that are turned from the object's own to the left.

    Of a polygon it need not lie about the object's pose.
    """
    half_m = 0.5 * np.array([shape.dimensions.x, shape.dimensions.y])
    if shape.type == _CYLINDER:
        return Outline(float(shape.dimensions.x), float(shape.dimensions.x))
    corners = half_m * [[1, 1], [1, -1], [-1, 1], [-1, -1]]
    if shape.type == _POLYGON and len(shape.footprint.points):
        corners = np.array([(p.x, p.y) for p in shape.footprint.points], dtype=np.float64)
    if turned_rad:
        cos, sin = math.cos(turned_rad), math.sin(turned_rad)
        corners = corners @ np.array([[cos, -sin], [sin, cos]])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return Outline(*(high - low).tolist(), *((low + high) / 2.0).tolist())


def height_m(user: drive.RoadUser) -> float:
    """Return the height that is usual for a road user's kind."""
    return HEIGHT_M[user.kind]


def classes_from(user: drive.RoadUser) -> list[Any]:
    """Return the ObjectClassification array of a road user."""
    kind = "autoware_perception_msgs/msg/ObjectClassification"
    return [ros_message(kind, label=_LABEL_BY_KIND[user.kind], probability=1.0)]


def shape_from(user: drive.RoadUser) -> Any:
    """Return the Shape of a road user: a box."""
    length_m, width_m = within_float32(user.length_m), within_float32(user.width_m)
    return ros_message(
        "autoware_perception_msgs/msg/Shape",
        type=_BOX,
        dimensions=vector_from(length_m, width_m, height_m(user)),
    )


def uuid_from(user: drive.RoadUser) -> Any:
    """Return the UUID of a road user's id."""
    octets = np.frombuffer(bytes.fromhex(uuid_text(user.user_id)), dtype=np.uint8).copy()
    return ros_message("unique_identifier_msgs/msg/UUID", uuid=octets)


def uuid_text(user_id: str) -> str:
    """Return the UUID that an id spells in 32 hexadecimal digits, else one derived from it."""
    try:
        return uuid.UUID(hex=user_id).hex
    except ValueError:
        return uuid.uuid5(_IDS, user_id).hex
