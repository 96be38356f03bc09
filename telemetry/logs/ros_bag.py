"""Bags of ROS 1 (.bag) and ROS 2 (a folder with metadata.yaml, or one .db3) as recordings."""

from __future__ import annotations

import errno
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.records import Schema
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import ReaderError as Error1
from rosbags.rosbag2 import Reader as Reader2
from rosbags.rosbag2 import ReaderError as Error2

from foretwin.contracts.errors import one_line
from foretwin.telemetry.logs.log import FILE_CUT_SHORT, LogError
from foretwin.telemetry.logs.mcap_records import Contents, Record, by_topic
from foretwin.telemetry.logs.ros_recording import NO_DEFINITION, ROS1, RosRecording

_ENCODINGS = {
    MessageDefinitionFormat.NONE: NO_DEFINITION,
    MessageDefinitionFormat.MSG: "ros2msg",
    MessageDefinitionFormat.IDL: "ros2idl",
}


def bag_recording(path: Path) -> RosRecording:
    """Open a bag; raises LogError where it cannot be read."""
    ros1 = path.is_file() and path.suffix.lower() != ".db3"
    kind: Any = Reader1 if ros1 else Reader2
    try:
        with kind(path) as reader:
            contents = _contents(reader, ros1=ros1)
    except (Error1, Error2) as error:
        hint = ""
        if "index" in str(error).lower():
            hint = "; `rosbag reindex` may mend it"
        elif path.is_dir() and any(path.glob("*.mcap")):
            hint = "; its .mcap files can be read one by one"
        raise LogError(f"{path}: unreadable bag: {error}{hint}") from None
    except OSError as error:
        if error.errno != errno.EINVAL:  # a place that the file says it has and has not
            raise
        raise LogError(f"{path}: unreadable bag: damaged: {one_line(error)}") from None
    except Exception as error:  # whatever rosbags raises over bytes that are damaged
        raise LogError(f"{path}: unreadable bag: damaged: {one_line(error)}") from None

    def read(topics: set[str], skipped: Counter[str]) -> Iterator[Record]:
        try:
            with kind(path) as reader:
                wanted = [one for one in reader.connections if one.topic in topics]
                # No connections at all would mean all of them.
                for one, log_time_ns, data in reader.messages(wanted) if wanted else ():
                    yield Record(one.topic, one.msgtype, log_time_ns, bytes(data))
        except GeneratorExit:
            raise
        except Exception:  # whatever rosbags, SQLite or zstd raise over bytes that are damaged
            skipped[FILE_CUT_SHORT] += 1

    return RosRecording(path=path, contents=contents, read=read)


def _contents(reader: Any, *, ros1: bool) -> Contents:
    # Of types with as many messages the first counts.
    schemas, counts = by_topic(
        (one.topic, _schema(one, ros1=ros1), one.msgcount) for one in reversed(reader.connections)
    )
    empty = not reader.message_count
    return Contents(
        schemas=schemas,
        counts=counts,
        first_ns=0 if empty else reader.start_time,
        last_ns=0 if empty else reader.end_time - 1,
        metadata={},
        indexed=False,
        cut_short=False,
    )


def _schema(connection: Any, *, ros1: bool) -> Schema:
    definition = connection.msgdef
    encoding = ROS1 if ros1 else _ENCODINGS[definition.format]
    data = definition.data.encode()
    return Schema(id=connection.id, name=connection.msgtype, encoding=encoding, data=data)
