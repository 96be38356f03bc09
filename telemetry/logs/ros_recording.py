"""Messages with ROS definitions in a file, whatever the file: MCAP or a bag of ROS 1 or ROS 2."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)

from foretwin.contracts.errors import one_line
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.mcap_records import Contents, Record, read_contents, records
from foretwin.telemetry.ros_messages.parts import schema_text, typestore

NO_DEFINITION = ""
"""Schema encoding of bags that name types without defining them (ROS 2 before Iron)."""
ROS1 = "ros1msg"
TYPE_CHANGED = "topic changed its type"
_IDL_RULE = "=" * 80 + "\n"


@dataclass(frozen=True, kw_only=True)
class RosRecording:
    """What a file holds, and how its messages are read again.

    `read` yields the messages of topics and counts damage in the counter it is given.
    """

    path: Path
    contents: Contents
    read: Callable[[set[str], Counter[str]], Iterator[Record]]

    def chosen(self, topics: set[str], skipped: Counter[str]) -> Iterator[Record]:
        """Yield the messages of topics, each of the type that most of its topic have."""
        for record in self.read(topics, skipped):
            if record.kind == self.contents.schemas[record.topic].name:
                yield record
            else:
                skipped[TYPE_CHANGED] += 1


def mcap_recording(path: Path) -> RosRecording:
    """Open an MCAP file; raises LogError where it is none."""
    contents = read_contents(path)
    return RosRecording(
        path=path,
        contents=contents,
        read=lambda topics, _skipped: records(path, contents, topics),
    )


def decoder(recording: RosRecording, topics: set[str]) -> Callable[[Record], Any]:
    """Return a decoder of topics by the definitions in the file itself, else by those known here.

    Raises LogError naming the topic whose definition is not there or cannot be read, and where one
    defines a type otherwise than ROS does.
    """
    known = recording.contents.schemas
    if undefined := sorted(topics - set(known)):
        raise LogError(
            f"{recording.path}: topic {undefined[0]}: the file does not say of what type"
        )
    schemas = {topic: known[topic] for topic in topics}
    for topic, schema in schemas.items():
        try:
            _types(schema.name, schema.encoding, schema.data)
        except Exception as error:  # rosbags raises many kinds over texts it cannot parse
            reason = str(error) if isinstance(error, LogError) else one_line(error)
            text = f"{recording.path}: topic {topic}: unreadable definition: {reason}"
            raise LogError(text) from None
    try:
        store = _store(frozenset((one.name, one.encoding, one.data) for one in schemas.values()))
    except TypesysError as error:
        raise LogError(f"{recording.path}: unreadable definitions: {one_line(error)}") from None
    if any(schema.encoding == ROS1 for schema in schemas.values()):
        return lambda record: store.deserialize_ros1(record.data, record.kind)
    return lambda record: store.deserialize_cdr(record.data, record.kind)


@functools.lru_cache(maxsize=64)
def _store(schemas: frozenset[tuple[str, str, bytes]]) -> Any:
    """Return the types of schemas: name, encoding and text of each."""
    types: Typesdict = {}
    for name, encoding, data in sorted(schemas):
        types.update(_types(name, encoding, data))
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


@functools.lru_cache(maxsize=256)
def _types(name: str, encoding: str, data: bytes) -> Typesdict:
    text = data.decode("utf-8", errors="replace")
    if encoding in ("ros2msg", ROS1):
        return get_types_from_msg(text, name)
    if encoding == "ros2idl":
        types: Typesdict = {}
        # Several files in one text: each after a rule and a line with its name.
        for part in text.split(_IDL_RULE):
            body = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
            if body.strip():
                types.update(get_types_from_idl(body))
        return types
    if encoding == NO_DEFINITION:
        if name not in typestore().types:
            raise LogError(f"the bag does not define type {name}")
        return get_types_from_msg(schema_text(name), name)
    raise LogError(f"schema encoding {encoding!r}; readable: ros2msg, ros2idl, {ROS1}")
