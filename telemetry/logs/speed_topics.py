"""Which topics of another program's recording tell no speed of the car's own body.

A twist may be of anything: receivers' drivers tell velocities to east and north in it
(nmea_navsat_driver x = v sin course, y = v cos course; ublox_gps velE, velN, -velD), others what
is commanded. Such a topic is known by its name, by its frame, or by going sideways as no car does.
"""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.ros_recording import RosRecording, decoder
from foretwin.telemetry.ros_messages.odometry import is_of_base, of_base
from foretwin.telemetry.ros_messages.parts import (
    BASE_FRAME,
    NAV_SAT_FIX,
    ODOMETRY,
    TWIST_STAMPED,
    TWIST_WITH_COVARIANCE_STAMPED,
)
from foretwin.telemetry.ros_messages.transforms import TransformTree

COMMANDED = "speed that is a command by its topic's name"
NOT_OF_THE_BODY = "speed in the receiver's frame, or in none"
SIDEWAYS = "speed that goes sideways as no car does"
UNTOLD = "odometry that moves and tells no speed"
_COMMAND_WORDS = frozenset({"command", "commands", "desired", "setpoint", "target"})
_MOST_LOOKED_AT = 5000
_MOVES_MPS = 1.0
"""Below it a twist is as much noise as motion."""
_MOST_SIDEWAYS = 0.3
"""Of the way ahead: with its sensor 3 m ahead of the rear axle a car goes so far sideways in a bend
of 10 m, and on the whole by much less."""
_MOVED_M = 1.0


def not_of_the_body(recording: RosRecording) -> dict[str, str]:
    """Return why, by topic, a recording's twists and odometry tell no speed of the car.

    Nothing is looked at where a VelocityReport, which is always of the car, goes before them.
    """
    schemas, counts = recording.contents.schemas, recording.contents.counts
    if any(one.name.endswith("/VelocityReport") and counts.get(t) for t, one in schemas.items()):
        return {}
    found = {}
    frames = {
        str(ros.header.frame_id).lstrip("/")
        for topic, schema in schemas.items()
        if schema.name == NAV_SAT_FIX
        for ros in itertools.islice(_messages(recording, topic), 1)
    }
    for topic, schema in schemas.items():
        if schema.name in (TWIST_STAMPED, TWIST_WITH_COVARIANCE_STAMPED):
            why = _fault_of_twist(recording, topic, (frames - {BASE_FRAME}) | {""})
        elif schema.name == ODOMETRY:
            why = UNTOLD if _tells_no_speed(_messages(recording, topic)) else None
        else:
            continue
        if why is not None:
            found[topic] = why
    return found


def of_other_bodies(recording: RosRecording, tree: TransformTree) -> set[str]:
    """Return the topics of odometry of which it is not known that it is, or can be, base_link's."""
    return {
        topic
        for topic, schema in recording.contents.schemas.items()
        if schema.name == ODOMETRY
        for ros in itertools.islice(_messages(recording, topic), 1)
        if not is_of_base(of_base(ros, tree))
    }


def _fault_of_twist(recording: RosRecording, topic: str, others: set[str]) -> str | None:
    words = re.split(r"[/_]", topic.lower())
    if any(word in _COMMAND_WORDS or word.startswith("cmd") for word in words):
        return COMMANDED
    ahead = sideways = 0.0
    for place, ros in enumerate(_messages(recording, topic)):
        if place == 0 and str(ros.header.frame_id).lstrip("/") in others:
            return NOT_OF_THE_BODY
        linear = getattr(ros.twist, "twist", ros.twist).linear
        if math.hypot(linear.x, linear.y) > _MOVES_MPS:
            ahead, sideways = ahead + abs(linear.x), sideways + abs(linear.y)
    return SIDEWAYS if sideways > _MOST_SIDEWAYS * ahead else None


def _tells_no_speed(messages: Iterator[Any]) -> bool:
    first: Any = None
    for ros in messages:
        linear, at = ros.twist.twist.linear, ros.pose.pose.position
        if linear.x or linear.y:
            return False
        first = at if first is None else first
        if math.hypot(at.x - first.x, at.y - first.y) > _MOVED_M:
            return True
    return False


def _messages(recording: RosRecording, topic: str) -> Iterator[Any]:
    """Yield a topic's first messages; what cannot be read is counted when it is read for good."""
    try:
        decode = decoder(recording, {topic})
    except LogError:
        return
    for record in itertools.islice(recording.chosen({topic}, Counter()), _MOST_LOOKED_AT):
        try:
            yield decode(record)
        except Exception:  # whatever rosbags raises over broken bytes
            continue
