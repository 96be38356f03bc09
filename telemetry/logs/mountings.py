"""How inertial units sit on the car, recorded and live: by static transforms, and by gravity.

Of a sensor that lies on its side or hangs upside down the turning rate about its own z is none of
the car's. Where a static transform tells its axes they are turned; where none does, or gravity
contradicts it, what it measured is left out.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.mcap_records import Record
from foretwin.telemetry.logs.ros_recording import RosRecording, decoder
from foretwin.telemetry.logs.units import STANDARD_GRAVITY_MPS2
from foretwin.telemetry.ros_messages.parts import BASE_FRAME, TF
from foretwin.telemetry.ros_messages.transforms import TransformTree

NOT_UPRIGHT = "imu that is not upright by gravity, and nothing says how it sits"
_MOST_LOOKED_AT = 1000
_GRAVITY_WITHIN = 0.25
"""Specific force is so near to 1 g in the mean, or gravity was taken out and says nothing."""
_MOST_TILT_RAD = math.radians(30.0)
"""By braking, bends and hills the mean of some seconds tilts by less."""


class ImuMounting(NamedTuple):
    """How an inertial unit's axes become the car's: by `turn` (3, 3), None where they are the same.

    Where it is not `upright` even so, nothing of it is of use.
    """

    turn: Array | None = None
    upright: bool = True

    def in_the_cars_axes(self, sample: drive.ImuSample) -> drive.ImuSample:
        """Return a sample in the car's axes, forward, left and up."""
        if self.turn is None:
            return sample
        accel, rate = (
            tuple((self.turn @ np.array(one)).tolist())
            for one in (sample.accel_mps2, sample.rate_radps)
        )
        return msgspec.structs.replace(sample, accel_mps2=accel, rate_radps=rate)


def by_gravity(mean_mps2: Array, turn: Array | None) -> ImuMounting:
    """Return how a unit sits whose specific force is (3,) in the mean, in its own axes."""
    up = mean_mps2 if turn is None else turn @ mean_mps2
    size_mps2 = float(np.linalg.norm(up))
    if abs(size_mps2 / STANDARD_GRAVITY_MPS2 - 1.0) > _GRAVITY_WITHIN:
        return ImuMounting(turn)
    tilt_rad = math.acos(np.clip(up[2] / size_mps2, -1.0, 1.0))
    return ImuMounting(turn, tilt_rad < _MOST_TILT_RAD)


class GravitySeen:
    """Follows which way gravity is in a unit's own axes, over its first samples."""

    def __init__(self) -> None:
        self._sum_mps2, self._count = np.zeros(3), 0

    def mounting(self, sample: drive.ImuSample, turn: Array | None) -> ImuMounting:
        """Return how the unit sits after one more sample, by `turn` as far as that is known."""
        force_mps2 = np.array(sample.accel_mps2)
        if self._count < _MOST_LOOKED_AT and np.isfinite(force_mps2).all():
            self._sum_mps2, self._count = self._sum_mps2 + force_mps2, self._count + 1
        if not self._count:
            return ImuMounting(turn)
        return by_gravity(self._sum_mps2 / self._count, turn)


def static_tree(recording: RosRecording) -> TransformTree | None:
    """Return a recording's static transforms, None where it has none that can be read."""
    schemas = recording.contents.schemas
    topics = {
        topic
        for topic, schema in schemas.items()
        if schema.name == TF and topic.endswith("tf_static")
    }
    if not topics:
        return None
    tree = TransformTree()
    try:
        decode = decoder(recording, topics)
        for record in recording.chosen(topics, Counter()):
            tree.add(decode(record))
    except Exception:  # a place that cannot be read is one that is not known
        return None
    return tree


def imu_mounting(
    recording: RosRecording,
    topic: str,
    decode: Callable[[Record], Any],
    tree: TransformTree | None,
) -> ImuMounting:
    """Return how the inertial unit of a topic sits, by its first messages and its frame."""
    forces = []
    turn: Array | None = None
    for record in itertools.islice(recording.chosen({topic}, Counter()), _MOST_LOOKED_AT):
        try:
            ros = decode(record)
            force, frame = ros.linear_acceleration, str(ros.header.frame_id)
        except Exception:  # an unreadable message, counted when it is read
            continue
        forces.append((force.x, force.y, force.z))
        if turn is None and tree is not None:
            turn = tree.turn_of(frame, within=BASE_FRAME)
    known = np.array(forces, dtype=np.float64).reshape(-1, 3)
    known = known[np.isfinite(known).all(axis=1)]
    if not len(known):
        return ImuMounting(turn)
    return by_gravity(np.mean(known, axis=0), turn)
