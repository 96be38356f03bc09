"""Messages to bytes and back: a fixed header with the schema version, then msgpack.

Header (little-endian, 24 bytes): magic `FTw1`, schema version u16, sender u16, sequence number u64,
the sender's wall clock in ns i64. A message of another schema version is refused. The sender is a
random number of who numbers, 0 where none is told: who begins anew numbers from 0 as another one.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import msgspec
import numpy as np
from msgspec import structs

from foretwin.contracts.arrays import array_from_wire, array_to_wire
from foretwin.contracts.errors import UserError
from foretwin.contracts.partial_file import partial_file

SCHEMA_VERSION = 2
MAGIC = b"FTw1"
_HEADER = struct.Struct("<4sHxxQq")
_NUMBERED_HEADER = struct.Struct("<4sHHQq")
_SENDER = struct.Struct("<6xH")
_PART = 256
"""So many items of a field are encoded at a time."""
MOST_SENDER = 2**16 - 1

Message = TypeVar("Message")


class SchemaMismatch(ValueError):  # noqa: N818
    """Bytes that are no message of this schema version; `kind` says in which way."""

    def __init__(self, text: str, *, kind: str = "no message") -> None:
        super().__init__(text)
        self.kind = kind


class Header(NamedTuple):
    """What stands before a message: its number by the sender's count, and the sender's clock."""

    seq: int
    sent_ns: int


class Envelope(NamedTuple, Generic[Message]):
    """A decoded message with its header."""

    seq: int
    sent_ns: int
    message: Message
    left_out: int = 0
    """Road users that the guard took out."""


def _to_wire(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return array_to_wire(value)
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"type {type(value).__name__} cannot be sent; messages hold structs and arrays")


def _from_wire(kind: type, value: Any) -> Any:
    if getattr(kind, "__origin__", kind) is np.ndarray:
        try:
            dtype, shape, data = value
            shape = tuple(shape)
        except (TypeError, ValueError):
            raise ValueError("an array of numpy is wanted, such as np.array(...) makes") from None
        return array_from_wire(dtype, shape, data)
    raise TypeError(f"no decoding known for {kind}")


_encoder = msgspec.msgpack.Encoder(enc_hook=_to_wire, order="deterministic")
_decoders: dict[Any, msgspec.msgpack.Decoder[Any]] = {}
_making = threading.Lock()
"""One decoder is made at a time: what msgspec (0.22) knows of a type it lets others use before it
knows all of it, and these then end the process."""


def encode(message: msgspec.Struct, *, seq: int = 0, sent_ns: int = 0, sender: int = 0) -> bytes:
    """Return header and body of one message."""
    header = _NUMBERED_HEADER.pack(MAGIC, SCHEMA_VERSION, sender, seq, sent_ns)
    return header + _encoder.encode(message)


def sender_of(data: bytes) -> int:
    """Return by whose numbering a message is numbered, 0 where that is not told."""
    return int(_SENDER.unpack_from(data)[0]) if len(data) >= _HEADER.size else 0


def header_of(data: bytes, *, where: str) -> Header:
    """Return what stands before a message; raises SchemaMismatch for other data or versions."""
    if len(data) < _HEADER.size or data[:4] != MAGIC:
        raise SchemaMismatch(f"{where}: not a foretwin message ({len(data)} bytes)")
    _, version, seq, sent_ns = _HEADER.unpack_from(data)
    if version != SCHEMA_VERSION:
        raise SchemaMismatch(
            f"{where}: schema version {version}; this foretwin reads version {SCHEMA_VERSION}",
            kind="another schema version",
        )
    return Header(seq, sent_ns)


def decode(data: bytes, kind: type[Message], *, where: str = "message") -> Envelope[Message]:
    """Return the message in `data`; `where` names the key or file in errors.

    Raises SchemaMismatch for other versions, other data, and bodies that do not fit `kind`.
    """
    seq, sent_ns = header_of(data, where=where)
    return Envelope(
        seq, sent_ns, decode_content(memoryview(data)[_HEADER.size :], kind, where=where)
    )


def decode_content(
    data: bytes | memoryview | msgspec.Raw, kind: type[Message], *, where: str
) -> Message:
    """Return the message of a body alone; raises SchemaMismatch where it does not fit `kind`."""
    decoder = _decoders.get(kind) or _decoder_of(kind)
    try:
        message: Message = decoder.decode(data)
    except Exception as error:  # whatever bytes of strangers make of it, depth and sizes included
        raise SchemaMismatch(
            f"{where}: no valid {kind.__name__}: {error}", kind=f"no valid {kind.__name__}"
        ) from error
    return message


def _decoder_of(kind: type[Message]) -> msgspec.msgpack.Decoder[Message]:
    with _making:
        if kind not in _decoders:
            _decoders[kind] = msgspec.msgpack.Decoder(kind, dec_hook=_from_wire)
        return _decoders[kind]


def content_bytes(message: msgspec.Struct | tuple[Any, ...]) -> bytes:
    """Return the body alone: equal for equal messages, so it can be hashed."""
    return _encoder.encode(message)


def content_parts(message: msgspec.Struct) -> Iterator[bytes]:
    """Yield `content_bytes` part by part, so that a large message need not be held beside them.

    https://github.com/msgpack/msgpack/blob/master/spec.md says what stands before maps and arrays.
    """
    config = message.__struct_config__
    if config.tag is not None or config.array_like or config.omit_defaults:
        yield content_bytes(message)
        return
    fields = [(one.encode_name, getattr(message, one.name)) for one in structs.fields(message)]
    told = [(name, value) for name, value in fields if value is not msgspec.UNSET]
    yield bytes([0x80 | len(told)]) if len(told) < 16 else struct.pack(">BH", 0xDE, len(told))
    for name, value in told:
        yield _encoder.encode(name)
        if not isinstance(value, tuple):
            yield _encoder.encode(value)
            continue
        yield _before_array(len(value))
        for first in range(0, len(value), _PART):
            part = value[first : first + _PART]
            yield _encoder.encode(part)[len(_before_array(len(part))) :]


def _before_array(count: int) -> bytes:
    if count < 16:
        return bytes([0x90 | count])
    return struct.pack(">BH", 0xDC, count) if count < 2**16 else struct.pack(">BI", 0xDD, count)


def write_message(message: msgspec.Struct, path: Path) -> None:
    """Write one message to a file, complete or not at all; raises OSError, and leaves nothing."""
    with partial_file(path) as partial, partial.open("wb") as file:
        file.write(_NUMBERED_HEADER.pack(MAGIC, SCHEMA_VERSION, 0, 0, 0))
        file.writelines(content_parts(message))


def read_message(path: Path, kind: type[Message]) -> Message:
    """Read one message from a file; raises SchemaMismatch naming the file."""
    return decode(path.read_bytes(), kind, where=str(path)).message


def read_given(path: Path, kind: type[Message]) -> Message:
    """Read one message from a file that a user named; raises UserError, in one line, where it holds
    something else or cannot be read."""
    try:
        return read_message(path, kind)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror or error}") from error
    except SchemaMismatch as error:
        raise UserError(" ".join(str(error).split())) from error
