"""Writing a drive to one MCAP file: profile ros2, CDR, `ros2msg` schemas, CRCs in every chunk.

Log time and publish time are both the message's own stamp. Metadata `foretwin.vehicle_info` holds
VehicleInfo, `foretwin.frame` the origin of the local frame named "map", as JSON.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import msgspec
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.telemetry.logs.mcap_records import SENDER
from foretwin.telemetry.ros_messages.parts import schema_text
from foretwin.telemetry.ros_messages.table import messages_from

FORMAT_METADATA = "foretwin.format"
INFO_METADATA = "foretwin.vehicle_info"
FRAME_METADATA = "foretwin.frame"
LIBRARY = "foretwin"
PART = "part"
"""In FORMAT_METADATA: which part of a recording a file is, where it is not the first."""
CHUNK_BYTES = 256 * 1024
"""Small, so that a killed recorder loses little."""
_EMPTY_CRC, _NO_SUMMARY = bytes(4), bytes(20)
ENDING = (
    bytes([Opcode.DATA_END, *len(_EMPTY_CRC).to_bytes(8, "little"), *_EMPTY_CRC])
    + bytes([Opcode.FOOTER, *len(_NO_SUMMARY).to_bytes(8, "little"), *_NO_SUMMARY])
    + MCAP0_MAGIC
)
"""Ends a file after any whole record, without an index, which readers rebuild."""


class _Whole:
    """Writes everything or raises; no buffer, so that an error belongs to the call that made it.

    No io.RawIOBase, since the mcap writer would put a buffer around one.
    """

    def __init__(self, raw: io.FileIO) -> None:
        self._raw = raw

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        while rest:
            rest = rest[self._raw.write(rest) or 0 :]
        return len(data)

    def tell(self) -> int:
        return self._raw.tell()

    def flush(self) -> None:
        """Nothing waits here."""

    def sync(self) -> None:
        """Wait until what was written would survive a power cut; memory has nothing to sync."""
        with contextlib.suppress(io.UnsupportedOperation):
            os.fdatasync(self._raw.fileno())


class DriveWriter:
    """Writes messages of a drive; a context manager that finishes the file.

    After an OSError (such as a full disk) the file is cut back to its last complete chunk and ended
    there, without the index, which readers rebuild; later messages are refused with the same error.
    """

    def __init__(
        self, raw: io.FileIO, *, info: drive.VehicleInfo | None = None, part: int = 1
    ) -> None:
        """`part` is the number of the file where a recording has several."""
        self.counts: Counter[str] = Counter()
        """Messages accepted, by channel."""
        self.held = 0
        """Of them, how many wait in the chunk in progress: an error or a kill loses them."""
        self.error: OSError | None = None
        self._raw = raw
        self._stream = _Whole(raw)
        self._frame: LocalFrame | None = None
        self._ids: dict[tuple[str, int], int] = {}
        self._schemas: dict[str, int] = {}
        self._whole_bytes = 0
        self._finished = False
        self._writer = Writer(
            self._stream,  # type: ignore[arg-type]
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            enable_crcs=True,
        )
        with self._guarded():
            self._writer.start(profile="ros2", library=LIBRARY)
            part_of = {} if part == 1 else {PART: str(part)}
            self._writer.add_metadata(FORMAT_METADATA, {"version": "1", **part_of})
        if info is not None:
            self.set_info(info)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.finish()

    def set_info(self, info: drive.VehicleInfo) -> None:
        """Write what is known of the vehicle; a later call counts."""
        with self._guarded():
            self._writer.add_metadata(INFO_METADATA, {"json": msgspec.json.encode(info).decode()})

    @property
    def size_bytes(self) -> int:
        """How much is in the file so far."""
        return self._whole_bytes

    def add(
        self,
        channel: str,
        message: msgspec.Struct,
        *,
        sequence: int | None = None,
        sender: int = 0,
    ) -> None:
        """Write one message, numbered by its `sender`, else as it comes.

        Raises OSError where the file cannot grow, and ValueError for what
        `foretwin.telemetry.ros_messages.table.messages_from` refuses.
        """
        parts = messages_from(channel, message, self._frame_for(message))
        stamp_ns = message.stamp_ns  # type: ignore[attr-defined]
        number = self.counts[channel] if sequence is None else sequence
        held, size = self.held + 1, self._whole_bytes
        with self._guarded():
            for topic, kind, data in parts:
                channel_id = self._channel_id(topic, kind, sender)
                before = self._stream.tell()
                self._writer.add_message(
                    channel_id=channel_id,
                    log_time=stamp_ns,
                    publish_time=stamp_ns,
                    data=data,
                    sequence=number & 0xFFFFFFFF,
                )
                if before > size:  # by the definition of the topic, before this message
                    held = 1
                size = self._stream.tell()
                # A chunk that is full has been written, and all so far is in it.
                held = 0 if size > before else max(held, 1)
        self.held = held
        self.counts[channel] += 1

    def flush(self) -> None:
        """End the chunk in progress, so that what was added so far survives a kill."""
        with self._guarded():
            self._writer.flush()  # type: ignore[no-untyped-call]
        self.held = 0

    def sync(self) -> None:
        """Put what was flushed on the disk, so that it survives a power cut."""
        with self._guarded():
            self._stream.sync()

    def finish(self) -> None:
        """End the file and close it; never raises: what went wrong stands in `error`."""
        if self._finished:
            return
        if self.error is None:
            with contextlib.suppress(OSError), self._guarded():
                self._writer.finish()  # type: ignore[no-untyped-call]
        self._finished = True
        with contextlib.suppress(OSError):
            self._raw.close()

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        if self.error is not None:
            raise self.error
        if self._finished:
            raise ValueError("the file is finished")
        try:
            yield
            self._whole_bytes = self._raw.tell()
        except OSError as error:
            self.error = error
            self._end_after_last_chunk()
            raise

    def _end_after_last_chunk(self) -> None:
        """Cut off the broken record and end the file, so that it can still be read."""
        with contextlib.suppress(OSError):
            self._raw.truncate(self._whole_bytes)
            self._raw.seek(self._whole_bytes)
            self._stream.write(ENDING)

    def _frame_for(self, message: msgspec.Struct) -> LocalFrame | None:
        """Return the local frame, whose origin is the first position that comes along."""
        if self._frame is None and (origin := position_of(message)) is not None:
            self._frame = LocalFrame(origin)
            with self._guarded():
                self._writer.add_metadata(
                    FRAME_METADATA, {"id": "map", "json": msgspec.json.encode(self._frame).decode()}
                )
        return self._frame

    def _channel_id(self, topic: str, kind: str, sender: int) -> int:
        """Return the channel of a topic and of who numbers its messages (0: not told)."""
        key = topic, sender
        if key not in self._ids:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(
                    name=kind, encoding="ros2msg", data=schema_text(kind).encode()
                )
            self._ids[key] = self._writer.register_channel(
                topic=topic,
                message_encoding="cdr",
                schema_id=self._schemas[kind],
                metadata={SENDER: str(sender)} if sender else {},
            )
        return self._ids[key]


def position_of(message: msgspec.Struct) -> GeoPoint | None:
    """Return the first position in a message that lies on Earth, None where there is none."""
    if isinstance(message, drive.PlannedTrajectory) and len(message.lat_deg):
        candidate = GeoPoint(float(message.lat_deg[0]), float(message.lon_deg[0]))
    elif isinstance(message, drive.GnssFix | drive.VehicleState):
        candidate = message.position
    else:
        return None
    try:
        return candidate.validate()
    except ValueError:
        return None


def create(path: Path, *, info: drive.VehicleInfo | None = None, part: int = 1) -> DriveWriter:
    """Create a file to write to; raises OSError where that is impossible."""
    raw = io.FileIO(os.fspath(path), "w")
    try:
        return DriveWriter(raw, info=info, part=part)
    except OSError:
        raw.close()
        raise
