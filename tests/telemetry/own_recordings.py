"""Everything in a recording of our own, the vehicle's states and `end` included."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import msgspec

from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.logs.log import Sample
from foretwin.telemetry.logs.ros_recording import mcap_recording
from foretwin.telemetry.logs.write_mcap import FRAME_METADATA
from foretwin.telemetry.ros_messages.parts import typestore
from foretwin.telemetry.ros_messages.table import kind_of, message_of


def read_drive(path: Path) -> Iterator[Sample]:
    """Yield every message by log time; unlike `open_mcap(path).samples()` nothing is refused."""
    recording = mcap_recording(path)
    told = recording.contents.metadata.get(FRAME_METADATA)
    frame = None if told is None else msgspec.json.decode(told["json"], type=LocalFrame)
    for record in recording.read(set(recording.contents.counts), Counter()):
        sample = message_from(record.topic, record.data, frame)
        if sample is not None:
            yield sample


def message_from(
    topic: str, data: bytes, frame: LocalFrame | None
) -> tuple[str, msgspec.Struct] | None:
    """Return channel and message of one of our own topics, None for views and other topics."""
    kind = kind_of(topic)
    if kind is None:
        return None
    return message_of(topic, typestore().deserialize_cdr(data, kind), frame)
