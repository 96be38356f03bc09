"""What a recording of ours holds as JSON: one channel read without decoding any other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

import msgspec

from foretwin.contracts.guard import Refused, admit
from foretwin.contracts.segments import segments_of
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.mcap_records import BROKEN, read_contents, records
from foretwin.telemetry.ros_messages.parts import STRING, typestore

STATES, OBJECTS = "/foretwin/state_json", "/foretwin/objects"
"""Topics of states as they were estimated then, and of the road users that a car detected."""
_Message = TypeVar("_Message", bound=msgspec.Struct)


def recorded_messages(
    first: Path, topic: str, kind: type[_Message], *, every_ns: int = 0
) -> Iterator[_Message]:
    """Yield the messages of a topic in a recording, its first part given, at least so far apart.

    What cannot be read is passed by: the rest of a part that breaks off, and messages that the
    guard refuses.
    """
    decoder, read = msgspec.json.Decoder(kind), typestore().deserialize_cdr
    for part in segments_of(first):
        last_ns: int | None = None
        try:
            for record in records(part, read_contents(part), {topic}):
                if last_ns is None or not 0 <= record.log_time_ns - last_ns < every_ns:
                    last_ns = record.log_time_ns
                    try:
                        message = decoder.decode(read(record.data, STRING).data)
                        yield admit(message, where=topic).message
                    except Refused:
                        continue
        except (LogError, OSError, msgspec.DecodeError, *BROKEN):
            continue
