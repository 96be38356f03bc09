"""Files as disks, networks, editors and ill will leave them: bytes put amiss by chance."""

from __future__ import annotations

import bz2
import gzip
import random
import re

NUMBERS = (
    b"1e999", b"-1e308", b"NaN", b"inf", b"99999999999999999999", b"-9223372036854775809", b"0",
    b"-0.0", b"1e-320", b"18446744073709551616", b"0x10", b"1_000", b"\xd9\xa3",
)  # fmt: skip
"""Instead of a number: too large, too small, none, or one in another writing."""
_STRAY = (
    b"\x00", b"\x00" * 64, b"\xff\xfe", b"\n", b"\x1b[2J", b"<", b"&", b'"', b",", b"{" * 3000,
    b"[" * 100_000, b"\xff" * 8,
)  # fmt: skip
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[^\s,;:=<>\"'{}\[\]*$]+")


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Return a file's bytes with one to four damages."""
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        data = chance.choice(_DAMAGES)(data, chance)
    return data


def _truncated(data: bytes, chance: random.Random) -> bytes:
    return data[: chance.randrange(len(data) + 1)]


def _flipped(data: bytes, chance: random.Random) -> bytes:
    flipped = bytearray(data)
    for _ in range(chance.choice((1, 1, 3, 30)) if flipped else 0):
        flipped[chance.randrange(len(flipped))] ^= 1 << chance.randrange(8)
    return bytes(flipped)


def _cut_out(data: bytes, chance: random.Random) -> bytes:
    first = chance.randrange(len(data) + 1)
    return data[:first] + data[first + chance.choice((1, 2, 7, 100, 4096)) :]


def _repeated(data: bytes, chance: random.Random) -> bytes:
    first = chance.randrange(len(data) + 1)
    last = min(len(data), first + chance.choice((1, 8, 64, 2000)))
    return data[:last] + data[first:last] * chance.choice((1, 2, 20)) + data[last:]


def _put_in(data: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(data) + 1)
    what = chance.choice((*_STRAY, chance.randbytes(12)))
    return data[:at] + what + data[at:]


def _number(data: bytes, chance: random.Random) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return _overwritten(data, chance)
    at = chance.choice(found)
    return data[: at.start()] + chance.choice(NUMBERS) + data[at.end() :]


def _overwritten(data: bytes, chance: random.Random) -> bytes:
    """Put a length or a number of 4 or 8 bytes that is too large where something stands."""
    at = chance.randrange(len(data) + 1)
    what = chance.choice((b"\xff" * 4, b"\xff" * 8, b"\x7f" + b"\xff" * 3, b"\x00" * 8,
                          b"\x00\x00\xf0\x7f", b"\xff\xff\xff\x7f"))  # fmt: skip
    return data[:at] + what + data[at + len(what) :]


def _swapped(data: bytes, chance: random.Random) -> bytes:
    """Change two fields, which are words of text."""
    found = list(_WORD.finditer(data))
    if len(found) < 2:
        return _overwritten(data, chance)
    one, other = sorted(chance.sample(found, 2), key=lambda word: word.start())
    between = data[one.end() : other.start()]
    return data[: one.start()] + other[0] + between + one[0] + data[other.end() :]


def _emptied(data: bytes, chance: random.Random) -> bytes:
    found = list(_WORD.finditer(data))
    if not found:
        return b""
    word = chance.choice(found)
    return data[: word.start()] + data[word.end() :]


def _another_encoding(data: bytes, chance: random.Random) -> bytes:
    text = data.decode("latin-1")
    match chance.randrange(5):
        case 0:
            return text.encode("utf-16")
        case 1:
            return b"\xef\xbb\xbf" + data
        case 2:
            return text.replace("e", "\xe9").encode("latin-1")
        case 3:
            return data.replace(b"\n", b"\r")
    return gzip.compress(data) if chance.random() < 0.5 else bz2.compress(data)


_DAMAGES = (
    _truncated, _flipped, _cut_out, _repeated, _put_in, _number, _number, _overwritten, _swapped,
    _emptied, _another_encoding,
)  # fmt: skip
