"""The messages of an MCAP file as records, also where the file was cut short."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from zstandard import ZstdError

from telemetry.logs.log import LogError

# What the mcap package raises over bytes that are no MCAP, or no longer.
_BROKEN = (McapError, EOFError, ValueError, KeyError, struct.error, ZstdError)


class Record(NamedTuple):
    """One message as it lies in the file."""

    topic: str
    kind: str
    log_time_ns: int
    data: bytes


class Contents(NamedTuple):
    """What a file holds: schemas and message counts by topic, its metadata by name.

    A file without an index, as after a crash, was read through once to learn this.
    """

    schemas: dict[str, Schema]
    counts: dict[str, int]
    first_ns: int
    last_ns: int
    metadata: dict[str, dict[str, str]]
    indexed: bool
    cut_short: bool


def read_contents(path: Path) -> Contents:
    """Return what a file holds; raises LogError where it is no MCAP."""
    with path.open("rb") as file:
        try:
            reader = make_reader(file)
            reader.get_header()
        except (*_BROKEN, StopIteration) as error:
            raise LogError(f"{path}: no MCAP file: {type(error).__name__} {error}") from None
        with contextlib.suppress(*_BROKEN, OSError, StopIteration):
            summary = reader.get_summary()
            if summary is not None and summary.statistics is not None and summary.chunk_indexes:
                told = summary.statistics
                channels = summary.channels.values()
                return Contents(
                    schemas={
                        channel.topic: summary.schemas[channel.schema_id]
                        for channel in channels
                        if channel.schema_id
                    },
                    counts={c.topic: told.channel_message_counts.get(c.id, 0) for c in channels},
                    first_ns=told.message_start_time,
                    last_ns=told.message_end_time,
                    metadata={item.name: dict(item.metadata) for item in reader.iter_metadata()},
                    indexed=True,
                    cut_short=False,
                )
    return _read_through(path)


def records(path: Path, contents: Contents, topics: set[str]) -> Iterator[Record]:
    """Yield the messages of `topics`: by log time where the file is indexed, else in file order.

    CRCs are checked. A file without an index ends where it was cut; raises LogError for damage in
    one with an index.
    """
    if not contents.indexed:
        for item in _Linear(path):
            if isinstance(item, Record) and item.topic in topics:
                yield item
        return
    with path.open("rb") as file:
        try:
            reader = make_reader(file, validate_crcs=True)
            for schema, channel, message in reader.iter_messages(topics=topics):
                if schema is not None:
                    yield Record(channel.topic, schema.name, message.log_time, message.data)
        except _BROKEN as error:
            raise LogError(f"{path}: damaged MCAP: {type(error).__name__} {error}") from None


def _read_through(path: Path) -> Contents:
    linear = _Linear(path)
    counts: dict[str, int] = {}
    metadata: dict[str, dict[str, str]] = {}
    first_ns, last_ns = 2**63, 0
    for item in linear:
        if isinstance(item, Metadata):
            metadata[item.name] = dict(item.metadata)
            continue
        counts[item.topic] = counts.get(item.topic, 0) + 1
        first_ns, last_ns = min(first_ns, item.log_time_ns), max(last_ns, item.log_time_ns)
    return Contents(
        schemas=linear.schemas,
        counts=counts,
        first_ns=first_ns if counts else 0,
        last_ns=last_ns,
        metadata=metadata,
        indexed=False,
        cut_short=linear.cut_short,
    )


class _Linear:
    """Reads a file from its beginning to its end or to where it is torn."""

    def __init__(self, path: Path) -> None:
        self.schemas: dict[str, Schema] = {}
        self.cut_short = False
        self._path = path

    def __iter__(self) -> Iterator[Record | Metadata]:
        by_id: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        with self._path.open("rb") as file:
            try:
                for item in StreamReader(file, validate_crcs=True).records:
                    if isinstance(item, Schema):
                        by_id[item.id] = item
                    elif isinstance(item, Channel):
                        channels[item.id] = item
                        if item.schema_id in by_id:
                            self.schemas[item.topic] = by_id[item.schema_id]
                    elif isinstance(item, Metadata):
                        yield item
                    elif isinstance(item, Message):
                        topic = channels[item.channel_id].topic
                        if topic in self.schemas:
                            kind = self.schemas[topic].name
                            yield Record(topic, kind, item.log_time, item.data)
            except _BROKEN:
                self.cut_short = True
