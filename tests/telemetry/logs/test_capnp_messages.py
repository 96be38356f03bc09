"""Cap'n Proto by hand: pointers, far ones too, and those that lead astray."""

from __future__ import annotations

import io
import struct

import pytest

from foretwin.telemetry.logs.capnp_messages import MessageError, Struct, messages


def message(*segments: bytes) -> bytes:
    sizes = [len(segments) - 1, *(len(segment) // 8 for segment in segments)]
    table = struct.pack(f"<{len(sizes)}I", *sizes)
    return table + bytes(-len(table) % 8) + b"".join(segments)


def to_struct(offset: int, data: int, pointers: int) -> bytes:
    return struct.pack("<IHH", offset << 2 & 0xFFFFFFFF, data, pointers)


def to_list(offset: int, code: int, count: int) -> bytes:
    return struct.pack("<II", offset << 2 & 0xFFFFFFFF | 1, code | count << 3)


def read(data: bytes) -> list[Struct]:
    return list(messages(io.BytesIO(data).read))


def test_numbers_bits_and_what_an_older_message_lacks() -> None:
    (root,) = read(message(to_struct(0, 1, 0) + struct.pack("<fI", 2.5, 0b100)))
    assert root.number("f", 0) == 2.5
    assert root.bit(34)
    assert not root.bit(33)
    assert root.number("d", 8) == 0
    assert root.struct(0) is None
    assert root.structs(3) == []
    assert root.floats(0) == ()


def test_a_list_of_floats_and_one_of_structs() -> None:
    floats = to_list(1, 4, 3)
    structs = to_list(2, 7, 2)
    body = to_struct(0, 0, 2) + floats + structs + struct.pack("<3fI", 1.0, 2.0, 3.0, 0)
    tag = struct.pack("<IHH", 2 << 2, 1, 0)
    (root,) = read(message(body + tag + struct.pack("<qq", 7, 8)))
    assert root.floats(0) == (1.0, 2.0, 3.0)
    assert [one.number("q", 0) for one in root.structs(1)] == [7, 8]


def test_a_far_pointer_leads_to_another_segment() -> None:
    far = struct.pack("<II", 0 << 3 | 2, 1)
    (root,) = read(message(far, to_struct(0, 1, 0) + struct.pack("<q", 42)))
    assert root.number("q", 0) == 42


@pytest.mark.parametrize(
    "body",
    [
        to_struct(0, 9, 0),
        to_struct(-5, 1, 0) + bytes(8),
        struct.pack("<II", 8 << 3 | 2, 0),
        struct.pack("<II", 2, 7),
        struct.pack("<II", 0 << 3 | 2, 0),
        struct.pack("<II", 4 | 2, 0),
    ],
)
def test_a_root_that_leads_astray_is_refused(body: bytes) -> None:
    with pytest.raises(MessageError):
        read(message(body))


@pytest.mark.parametrize(
    "pointer", [to_list(0, 4, 1 << 20), to_list(-9, 4, 1), to_list(0, 2, 1), to_struct(0, 0, 0)]
)
def test_a_list_that_leads_astray_is_refused(pointer: bytes) -> None:
    (root,) = read(message(to_struct(0, 0, 1) + pointer + bytes(8)))
    if pointer == to_struct(0, 0, 0):
        assert root.floats(0) == ()
        return
    with pytest.raises(MessageError):
        root.floats(0)


def test_more_structs_than_their_words_are_refused() -> None:
    tag = struct.pack("<IHH", 1000 << 2, 1, 0)
    (root,) = read(message(to_struct(0, 0, 1) + to_list(0, 7, 1) + tag + bytes(8)))
    with pytest.raises(MessageError, match="longer than its words"):
        root.structs(0)


def test_streams_that_end_or_are_too_large() -> None:
    whole = message(to_struct(0, 1, 0) + bytes(8))
    assert len(read(whole * 3)) == 3
    for data in (whole[:10], whole + b"\x00", b"\xff\xff\xff\x7f", struct.pack("<II", 0, 1 << 30)):
        with pytest.raises(MessageError):
            read(data)
