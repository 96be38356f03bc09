"""What rmw_zenoh attaches to each sample: sequence number, time of sending, the sender's id.

33 bytes `<qqB16s` since 0.2.4; before, each value stood behind its name. Subscribers in ROS refuse
samples without it.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

_NOW = struct.Struct("<qqB16s")
_GID_BYTES = 16
_LABELS = (b"sequence_number", b"source_timestamp", b"source_gid")


class Attachment(NamedTuple):
    """One sample's sequence number, wall time of sending in ns, and 16 bytes of the sender."""

    seq: int
    sent_ns: int
    gid: bytes


def pack(attachment: Attachment) -> bytes:
    """Return the 33 bytes; raises ValueError for an id of another length."""
    if len(attachment.gid) != _GID_BYTES:
        raise ValueError(f"gid of {len(attachment.gid)} bytes; rmw_zenoh's have {_GID_BYTES}")
    return _NOW.pack(attachment.seq, attachment.sent_ns, _GID_BYTES, attachment.gid)


def unpack(data: bytes) -> Attachment:
    """Return what is attached, of either form; raises ValueError for other bytes."""
    if len(data) == _NOW.size:
        seq, sent_ns, length, gid = _NOW.unpack(data)
        if length == _GID_BYTES:
            return Attachment(seq, sent_ns, gid)
    return _unpack_labelled(data)


def _unpack_labelled(data: bytes) -> Attachment:
    offset = 0
    values: list[bytes] = []
    for label, size in zip(_LABELS, (8, 8, 1 + _GID_BYTES), strict=True):
        start = offset + 1 + len(label)
        value = data[start : start + size]
        if data[offset:start] != bytes([len(label)]) + label or len(value) != size:
            raise ValueError(f"{len(data)} bytes that are no attachment of rmw_zenoh")
        values.append(value)
        offset = start + size
    (seq,) = struct.unpack("<q", values[0])
    (sent_ns,) = struct.unpack("<q", values[1])
    return Attachment(seq, sent_ns, values[2][1:])
