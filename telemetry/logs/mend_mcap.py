"""Ending an MCAP file whose writer was killed, or lost its power: cut to what is whole."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import NamedTuple

from mcap.records import Chunk, DataEnd, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from foretwin.contracts.errors import one_line
from foretwin.telemetry.logs.write_mcap import ENDING

log = logging.getLogger("foretwin.telemetry.logs.mend_mcap")


class FoundMcap(NamedTuple):
    """How far a file can be read: messages, the newest log time, and what of its bytes is lost.

    `ended` says that it is whole, with its end; `data_bytes` that its data reach up to there.
    """

    messages: int
    last_ns: int
    data_bytes: int
    torn_bytes: int
    ended: bool


def look_through(path: Path) -> FoundMcap:
    """Read a file up to its end or to where it is torn; checksums count. Raises OSError."""
    messages = last_ns = data_bytes = 0
    data_ended = ended = False
    size = path.stat().st_size
    with path.open("rb") as file:
        reader = StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=size)
        try:
            for record in reader.records:
                if isinstance(record, DataEnd):
                    data_ended = True
                if data_ended:
                    continue
                held = [record]
                if isinstance(record, Chunk):
                    held = breakup_chunk(record, validate_crc=True)
                stamps = [one.log_time for one in held if isinstance(one, Message)]
                messages += len(stamps)
                last_ns = max(last_ns, *stamps, 0)
                data_bytes = file.tell()
            ended = True
        except OSError:
            raise
        except Exception as damage:  # whatever the mcap package makes of bytes that are none
            log.info("%s: whole up to byte %d: %s", path, data_bytes, one_line(damage))
    torn = 0 if data_ended else size - data_bytes
    return FoundMcap(messages, last_ns, data_bytes, torn, ended)


def mend(path: Path) -> FoundMcap:
    """End a file after its last whole record, where it has no end; returns how it was.

    It is left as it is where nothing of it is whole. A mend that is interrupted can be done again.
    Raises OSError.
    """
    found = look_through(path)
    if not found.ended and found.data_bytes:
        with path.open("r+b") as file:
            file.truncate(found.data_bytes)
            file.seek(found.data_bytes)
            file.write(ENDING)
            file.flush()
            os.fsync(file.fileno())
    return found
