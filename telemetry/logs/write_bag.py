"""Writing a drive to a bag: a ROS 2 folder with SQLite, or a ROS 1 file.

Topics and types are those of `ros_messages.table`; vehicle and frame stand in the String topics
INFO_TOPIC and FRAME_TOPIC. A ROS 1 bag defines in itself the types that ROS 1 does not have, such
as Autoware's Trajectory.
"""

from __future__ import annotations

import functools
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from foretwin.contracts import drive
from foretwin.contracts.frames import LocalFrame
from foretwin.telemetry.logs.write_mcap import position_of
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.parts import STRING, typestore
from foretwin.telemetry.ros_messages.table import FRAME_TOPIC, INFO_TOPIC, messages_from


class BagWriter:
    """Writes messages of a drive to a bag of ROS 1 or ROS 2; nothing may be at `path` yet.

    `close` ends it; `abort` leaves what is there without an index.
    """

    def __init__(self, path: Path, *, ros1: bool, info: drive.VehicleInfo) -> None:
        self.counts: Counter[str] = Counter()
        """Messages accepted, by channel."""
        self._ros1 = ros1
        self._writer: Any = (
            Writer1(path)
            if ros1
            else Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
        )
        self._connections: dict[str, Any] = {}
        self._frame: LocalFrame | None = None
        self._info: drive.VehicleInfo | None = info
        self._writer.open()

    def add(self, channel: str, message: msgspec.Struct) -> None:
        """Write one message; raises ValueError for what `messages_from` refuses."""
        stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        if self._info is not None:
            self._describe(INFO_TOPIC, self._info, stamp_ns)
            self._info = None
        if self._frame is None and (origin := position_of(message)) is not None:
            self._frame = LocalFrame(origin)
            self._describe(FRAME_TOPIC, self._frame, stamp_ns)
        for topic, kind, data in messages_from(channel, message, self._frame):
            self._write(topic, kind, data, stamp_ns)
        self.counts[channel] += 1

    def close(self) -> None:
        """End the bag."""
        self._writer.close()

    def abort(self) -> None:
        """Give the bag up."""
        self._writer.abort()

    def _describe(self, topic: str, what: msgspec.Struct, stamp_ns: int) -> None:
        data = typestore().serialize_cdr(parts.json_string(what), STRING)
        self._write(topic, STRING, bytes(data), stamp_ns)

    def _write(self, topic: str, kind: str, data: bytes, stamp_ns: int) -> None:
        if topic not in self._connections:
            definition = _ros1_definition(kind) if self._ros1 else _ros2_definition(kind)
            self._connections[topic] = self._writer.add_connection(topic, kind, **definition)
        if self._ros1:
            data = bytes(typestore().cdr_to_ros1(data, kind))
            # To ROS 1 the time 0 is none: `rosbag play` would leave it out (TIME_MIN is 1 ns).
            stamp_ns = max(stamp_ns, 1)
        self._writer.write(self._connections[topic], stamp_ns, data)


@functools.cache
def _ros2_definition(kind: str) -> dict[str, str]:
    return {"msgdef": parts.schema_text(kind), "rihs01": typestore().hash_rihs01(kind)}


@functools.cache
def _ros1_definition(kind: str) -> dict[str, str]:
    text, digest = _ros1_types().generate_msgdef(kind, ros_version=1)
    return {"msgdef": text, "md5sum": digest}


@functools.cache
def _ros1_types() -> Any:
    store = get_typestore(Stores.ROS1_NOETIC)
    missing = {
        name: one for name, one in parts.types_beside_ros().items() if name not in store.types
    }
    store.register(missing)
    return store
