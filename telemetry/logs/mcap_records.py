"""The messages of an MCAP file as records, also where the file was cut short."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, NamedTuple

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdError

from foretwin.contracts.codec import MOST_SENDER
from foretwin.telemetry.logs.log import LogError

BROKEN = (
    McapError,
    EOFError,
    ValueError,
    KeyError,
    OverflowError,
    struct.error,
    ZstdError,
    MemoryError,
)
"""What the mcap package raises over bytes that are no MCAP, or no longer."""

MOST_CHUNK_BYTES = 64 * 2**20
MOST_RATIO = 200
"""A chunk beyond both is a bomb: recordings are packed 2 to 20 times, in chunks of some MB."""


SENDER = "foretwin.sender"
"""Of a channel's metadata: by whose numbering its messages are numbered."""


class Record(NamedTuple):
    """One message as it lies in the file."""

    topic: str
    kind: str
    log_time_ns: int
    data: bytes
    sequence: int = 0
    """Its sender's number."""
    sender: int = 0
    """By whose numbering that is; 0 where it is not told."""


def _record(channel: Channel, kind: str, message: Message) -> Record:
    told = channel.metadata.get(SENDER, "")
    sender = int(told) if told.isdecimal() and len(told) <= len(str(MOST_SENDER)) else 0
    return Record(channel.topic, kind, message.log_time, message.data, message.sequence, sender)


class Contents(NamedTuple):
    """What a file holds: schemas and message counts by topic, its metadata by name.

    A topic of several types has the schema of the type that most of its messages have, and their
    number.
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
        except (*BROKEN, StopIteration) as error:
            raise LogError(f"{path}: no MCAP file: {type(error).__name__} {error}") from None
        try:
            summary = reader.get_summary()
            if summary is not None and summary.statistics is not None and summary.chunk_indexes:
                for chunk in summary.chunk_indexes:
                    _check_packing(path, chunk.compressed_size, chunk.uncompressed_size)
                statistics = summary.statistics
                schemas, counts = by_topic(
                    (
                        channel.topic,
                        summary.schemas.get(channel.schema_id),
                        statistics.channel_message_counts.get(channel.id, 0),
                    )
                    for channel in summary.channels.values()
                )
                return Contents(
                    schemas=schemas,
                    counts=counts,
                    first_ns=statistics.message_start_time,
                    last_ns=statistics.message_end_time,
                    metadata={item.name: dict(item.metadata) for item in reader.iter_metadata()},
                    indexed=True,
                    cut_short=False,
                )
        except LogError:
            raise
        except (*BROKEN, OSError, StopIteration):
            pass  # It can still be read through.
    return _read_through(path)


def _check_packing(path: Path, packed: int, unpacked: int) -> None:
    """Raise LogError for a chunk that says that it unpacks to far more than any log does."""
    if unpacked > MOST_CHUNK_BYTES and unpacked > MOST_RATIO * packed:
        raise LogError(
            f"{path}: a chunk of {packed} bytes unpacks to {unpacked}: no log is packed "
            f"{MOST_RATIO} times"
        )


def read_metadata(path: Path, name: str) -> dict[str, str]:
    """Return what stands under a name at the beginning of a file, before its first message.

    Nothing where it is not there; raises LogError for a file that is no MCAP.
    """
    with path.open("rb") as file:
        try:
            for item in StreamReader(file, emit_chunks=True).records:
                if isinstance(item, Metadata) and item.name == name:
                    return dict(item.metadata)
                if isinstance(item, Chunk):
                    break
        except (*BROKEN, StopIteration, OSError) as error:
            raise LogError(f"{path}: no MCAP file: {type(error).__name__} {error}") from None
    return {}


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
                    yield _record(channel, schema.name, message)
        except (*BROKEN, OSError) as error:  # a place before the file's begin cannot be gone to
            raise LogError(f"{path}: damaged MCAP: {type(error).__name__} {error}") from None


def in_file_order(path: Path) -> Iterator[Record]:
    """Yield all messages from the beginning to the end, or to where the file is torn."""
    for item in _Linear(path):
        if isinstance(item, Record):
            yield item


def _read_through(path: Path) -> Contents:
    linear = _Linear(path)
    seen: Counter[tuple[str, str]] = Counter()
    metadata: dict[str, dict[str, str]] = {}
    first_ns, last_ns = 2**63, 0
    for item in linear:
        if isinstance(item, Metadata):
            metadata[item.name] = dict(item.metadata)
            continue
        seen[item.topic, item.kind] += 1
        first_ns, last_ns = min(first_ns, item.log_time_ns), max(last_ns, item.log_time_ns)
    schemas, counts = by_topic(
        (topic, linear.schemas[topic, kind], count) for (topic, kind), count in seen.items()
    )
    return Contents(
        schemas=schemas,
        counts=counts,
        first_ns=first_ns if counts else 0,
        last_ns=last_ns,
        metadata=metadata,
        indexed=False,
        cut_short=linear.cut_short,
    )


def by_topic(
    channels: Iterable[tuple[str, Schema | None, int]],
) -> tuple[dict[str, Schema], dict[str, int]]:
    """Return schema and count by topic, of the schema with the most messages."""
    totals: Counter[tuple[str, str]] = Counter()
    schemas: dict[tuple[str, str], Schema] = {}
    for topic, schema, count in channels:
        name = "" if schema is None else schema.name
        totals[topic, name] += count
        if schema is not None:
            schemas[topic, name] = schema
    best = {topic: name for (topic, name), _ in sorted(totals.items(), key=lambda item: item[1])}
    return (
        {topic: schemas[topic, name] for topic, name in best.items() if (topic, name) in schemas},
        {topic: totals[topic, name] for topic, name in best.items()},
    )


class _Linear:
    """Reads a file from its beginning to its end or to where it is torn."""

    def __init__(self, path: Path) -> None:
        self.schemas: dict[tuple[str, str], Schema] = {}
        self.cut_short = False
        self._path = path

    def __iter__(self) -> Iterator[Record | Metadata]:
        by_id: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        with self._path.open("rb") as file:
            try:
                for item in self._unpacked(file):
                    if isinstance(item, Schema):
                        by_id[item.id] = item
                    elif isinstance(item, Channel):
                        channels[item.id] = item
                        if item.schema_id in by_id:
                            schema = by_id[item.schema_id]
                            self.schemas[item.topic, schema.name] = schema
                    elif isinstance(item, Metadata):
                        yield item
                    elif isinstance(item, Message):
                        channel = channels[item.channel_id]
                        if channel.schema_id in by_id:
                            kind = by_id[channel.schema_id].name
                            yield _record(channel, kind, item)
            except LogError:
                raise
            except BROKEN:
                self.cut_short = True

    def _unpacked(self, file: IO[bytes]) -> Iterator[McapRecord]:
        for item in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
            if isinstance(item, Chunk):
                _check_packing(self._path, len(item.data), item.uncompressed_size)
                yield from breakup_chunk(item, validate_crc=True)
            else:
                yield item
