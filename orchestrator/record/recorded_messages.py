"""What a recording of ours holds as JSON: some channels read without decoding any other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

import msgspec

from foretwin.contracts.drive import RoadUsers, VehicleState
from foretwin.contracts.guard import Refused, admit
from foretwin.contracts.segments import segments_of
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.mcap_records import BROKEN, read_contents, records
from foretwin.telemetry.ros_messages.parts import STRING, typestore

STATES, OBJECTS = "/foretwin/state_json", "/foretwin/objects"
"""Topics of states as they were estimated then, and of the road users that a car detected."""
_EVERY_NS = 100_000_000
"""Where a car was is looked at ten times a second."""
_Message = TypeVar("_Message", bound=msgspec.Struct)


class TopicRead(NamedTuple, Generic[_Message]):
    """A topic that is read, and how far its messages are apart at least."""

    topic: str
    kind: type[_Message]
    every_ns: int = 0


def recorded_messages(first: Path, *asked: TopicRead[_Message]) -> Iterator[_Message]:
    """Yield the messages of topics in a recording, its first part given, in one walk through it.

    What cannot be read is passed by: the rest of a part that breaks off, of a topic in it that
    does, and messages that the guard refuses.
    """
    read = typestore().deserialize_cdr
    decoders = {one.topic: msgspec.json.Decoder(one.kind) for one in asked}
    every_ns = {one.topic: one.every_ns for one in asked}
    for part in segments_of(first):
        last_ns: dict[str, int] = {}
        broken: set[str] = set()
        try:
            for record in records(part, read_contents(part), set(decoders)):
                topic, at_ns = record.topic, record.log_time_ns
                if topic in broken or 0 <= at_ns - last_ns.get(topic, at_ns + 1) < every_ns[topic]:
                    continue
                last_ns[topic] = at_ns
                try:
                    message = decoders[topic].decode(read(record.data, STRING).data)
                    yield admit(message, where=topic).message
                except Refused:
                    continue
                except msgspec.DecodeError:
                    broken.add(topic)
        except (LogError, OSError, *BROKEN):
            continue


class CarRecorded(NamedTuple):
    """What a run recorded of its car: states as they were estimated then, ten a second at most,
    and all that it said of other road users."""

    states: tuple[VehicleState, ...]
    objects: tuple[RoadUsers, ...]


def car_recorded(first: Path) -> CarRecorded:
    """Return what a recording, its first part given, holds of the car; what cannot be read is
    passed by."""
    topics: tuple[TopicRead[VehicleState | RoadUsers], ...] = (
        TopicRead(STATES, VehicleState, _EVERY_NS),
        TopicRead(OBJECTS, RoadUsers),
    )
    states, objects = [], []
    for message in recorded_messages(first, *topics):
        if isinstance(message, VehicleState):
            states.append(message)
        else:
            objects.append(message)
    return CarRecorded(tuple(states), tuple(objects))
