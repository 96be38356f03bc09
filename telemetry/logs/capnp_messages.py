"""Cap'n Proto messages one after the other, as far as logs need them: structs and lists.

By the encoding's specification (capnproto.org/encoding.html): words of 8 bytes, little-endian. What
a pointer says is believed only within its segment, and what is not there reads as zero or as
nothing, as a reader of a newer schema must read an older message.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

MOST_SEGMENTS = 512
MOST_BYTES = 1 << 26
"""Of one message: an event of a log is some kilobytes, a compressed picture some hundred."""
_WORD = 8
_STRUCT, _LIST, _FAR = 0, 1, 2
_COMPOSITE = 7
_LIST_BYTES = {2: 1, 3: 2, 4: 4, 5: 8}
"""Bytes of an element by the pointer's code, for numbers."""


class MessageError(Exception):
    """Bytes that are no message, or one that points beyond itself."""


class Struct(NamedTuple):
    """A struct in a message: where its data and its pointers lie in a segment."""

    segments: list[bytes]
    segment: int
    data_at: int
    data_bytes: int
    pointers: int

    def number(self, layout: str, at: int) -> float:
        """Return the number at a byte of the data, by its letter of `struct`; 0 beyond the data."""
        if at + struct.calcsize(layout) > self.data_bytes:
            return 0
        value: float = struct.unpack_from(
            f"<{layout}", self.segments[self.segment], self.data_at + at
        )[0]
        return value

    def bit(self, at: int) -> bool:
        """Return a bit of the data, counted from the first; false beyond the data."""
        return bool(int(self.number("B", at // 8)) >> at % 8 & 1)

    def struct(self, index: int) -> Struct | None:
        """Return the struct that a pointer leads to; raises MessageError where it leads astray."""
        found = self._target(index)
        return None if found is None else _struct(self.segments, *found)

    def structs(self, index: int) -> list[Struct]:
        """Return the structs of a list; raises MessageError where the pointer leads astray."""
        found = self._target(index)
        if found is None:
            return []
        segment, at, word = found
        first, words = _list_at(self.segments, segment, at, word)
        if word >> 32 & 7 != _COMPOSITE:
            raise MessageError("a list of something else than structs")
        tag = _read(self.segments, segment, first)
        count, data, pointers = tag >> 2 & 0x3FFFFFFF, tag >> 32 & 0xFFFF, tag >> 48
        if count * (data + pointers) > words or (count and not data + pointers):
            raise MessageError("a list longer than its words")
        size = (data + pointers) * _WORD
        return [
            Struct(self.segments, segment, first + _WORD + n * size, data * _WORD, pointers)
            for n in range(count)
        ]

    def floats(self, index: int) -> tuple[float, ...]:
        """Return a list of 32 bit floats; raises MessageError where the pointer leads astray."""
        found = self._target(index)
        if found is None:
            return ()
        segment, at, word = found
        if _LIST_BYTES.get(word >> 32 & 7) != 4:
            raise MessageError("a list of something else than 32 bit floats")
        first, count = _list_at(self.segments, segment, at, word)
        return struct.unpack_from(f"<{count}f", self.segments[segment], first)

    def _target(self, index: int) -> tuple[int, int, int] | None:
        """Return segment, byte and word of a pointer that is no far one; None where it is null."""
        if index >= self.pointers:
            return None
        return _followed(
            self.segments, self.segment, self.data_at + self.data_bytes + index * _WORD
        )


def messages(read: Callable[[int], bytes]) -> Iterator[Struct]:
    """Yield the root of each message that `read`, as of a file, gives.

    Raises MessageError where they end amid one or are none.
    """
    while head := read(4):
        if len(head) < 4:
            raise MessageError("cut off")
        count = int.from_bytes(head, "little") + 1
        if count > MOST_SEGMENTS:
            raise MessageError(f"{count} segments")
        # The table is filled up to a whole word.
        table = _exactly(read, 4 * count + 4 * (count % 2 == 0))
        sizes = [_WORD * size for size in struct.unpack_from(f"<{count}I", table)]
        if sum(sizes) > MOST_BYTES:
            raise MessageError(f"a message of {sum(sizes)} bytes")
        body = _exactly(read, sum(sizes))
        segments, at = [], 0
        for size in sizes:
            segments.append(body[at : at + size])
            at += size
        root = _followed(segments, 0, 0) if sizes[0] else None
        if root is not None:
            yield _struct(segments, *root)


def _exactly(read: Callable[[int], bytes], size: int) -> bytes:
    parts = []
    while size > 0:
        part = read(size)
        if not part:
            raise MessageError("cut off")
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


def _read(segments: list[bytes], segment: int, at: int) -> int:
    if segment >= len(segments) or at < 0 or at + _WORD > len(segments[segment]):
        raise MessageError("a pointer beyond its segment")
    return int.from_bytes(segments[segment][at : at + _WORD], "little")


def _followed(segments: list[bytes], segment: int, at: int) -> tuple[int, int, int] | None:
    word = _read(segments, segment, at)
    if word & 3 == _FAR:
        landing, segment = (word >> 3 & 0x1FFFFFFF) * _WORD, word >> 32
        if word & 4:
            raise MessageError("a far pointer with two landings")
        at, word = landing, _read(segments, segment, landing)
        if word & 3 == _FAR:
            raise MessageError("a far pointer to a far pointer")
    return None if word == 0 else (segment, at, word)


def _offset(word: int) -> int:
    offset = word >> 2 & 0x3FFFFFFF
    return offset - (1 << 30) if offset >= 1 << 29 else offset


def _struct(segments: list[bytes], segment: int, at: int, word: int) -> Struct:
    data, pointers = word >> 32 & 0xFFFF, word >> 48
    first = at + _WORD + _offset(word) * _WORD
    if (
        word & 3 != _STRUCT
        or first < 0
        or first + (data + pointers) * _WORD > len(segments[segment])
    ):
        raise MessageError("a struct beyond its segment")
    return Struct(segments, segment, first, data * _WORD, pointers)


def _list_at(segments: list[bytes], segment: int, at: int, word: int) -> tuple[int, int]:
    """Return where a list begins and how many elements it has; of structs, how many words."""
    code, count = word >> 32 & 7, word >> 35
    first = at + _WORD + _offset(word) * _WORD
    size = (count + 1) * _WORD if code == _COMPOSITE else count * _LIST_BYTES.get(code, 0)
    if word & 3 != _LIST or first < 0 or first + size > len(segments[segment]):
        raise MessageError("a list beyond its segment")
    return first, count
