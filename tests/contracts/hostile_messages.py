"""Messages as a stranger sends them: well formed in the main, with leaves and bytes put amiss."""

from __future__ import annotations

import random
import struct
from typing import Any, get_args, get_origin

import msgspec
import numpy as np

from foretwin.contracts.arrays import array_to_wire
from foretwin.contracts.codec import MAGIC, SCHEMA_VERSION

HOSTILE: tuple[Any, ...] = (
    float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 0.0, -1.0, 1e-300, 2**63 - 1,
    -(2**63), 2**64 - 1, 0, -1, "", "../../etc/passwd", "[/a] Lane", "\x1b[31m", "\u202e",
    "a" * 30_000, "null", None, True, b"", b"\x00" * 40, [], {}, [1.0], ("<f8", (3,), b"\x00" * 24),
    ("<f8", (-1,), b"\x00" * 16), ("|b1", (2,), b"\x00\x01"), ("<f8", (2**63,), b""),
    ("<f8", (0,), b""), ("<f4", (1, 1, 1), b"\x00" * 4),
)  # fmt: skip
"""What a leaf may be instead: numbers, texts, bytes and arrays that are of no use, or of little."""


def plain(kind: Any, chance: random.Random) -> Any:
    """Return something that decodes as `kind`, in what msgpack knows: numbers are ordinary ones."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return {
            field.name: plain(field.type, chance)
            for field in msgspec.structs.fields(kind)
            if field.required or chance.random() < 0.7
        }
    origin, args = get_origin(kind), get_args(kind)
    if origin is np.ndarray:
        return array_to_wire(np.array([chance.uniform(-2.0, 2.0) for _ in range(3)]))
    if origin is tuple:
        inner = args[:1] * chance.randrange(3) if args[-1] is Ellipsis else args
        return [plain(one, chance) for one in inner]
    if origin is dict:
        return {str(n): plain(args[1], chance) for n in range(chance.randrange(3))}
    if origin is not None and str(origin).endswith("Literal"):
        return chance.choice(args)
    if args:
        return plain(chance.choice(args), chance)
    if kind is int:
        return 1_000_000_000 + chance.randrange(10**9)
    words: dict[Any, Any] = {
        float: chance.uniform(-2.0, 2.0), str: chance.choice(("a", "w0", "n4")),
        bool: chance.random() < 0.5, bytes: b"", type(None): None, msgspec.Raw: {},
    }  # fmt: skip
    return words[kind]


def amiss(body: Any, chance: random.Random) -> Any:
    """Return the body with one leaf of it, or a branch, put amiss."""
    if isinstance(body, dict) and body and chance.random() < 0.95:
        name = chance.choice(sorted(body))
        if chance.random() < 0.05:
            return {key: value for key, value in body.items() if key != name}
        return body | {name: amiss(body[name], chance)}
    if isinstance(body, list) and body and chance.random() < 0.9:
        place = chance.randrange(len(body))
        return [*body[:place], amiss(body[place], chance), *body[place + 1 :]]
    return chance.choice(HOSTILE)


def hostile_bytes(kind: type[msgspec.Struct], chance: random.Random) -> bytes:
    """Return bytes on a channel of `kind`: a message amiss, or no message at all."""
    body = plain(kind, chance)
    for _ in range(chance.randrange(3)):
        body = amiss(body, chance)
    seq = chance.choice((0, 1, chance.randrange(100), 2**64 - 1))
    sent_ns = chance.choice((0, -(2**63), 2**63 - 1, 1_800_000_000_000_000_000))
    data = struct.pack("<4sHxxQq", MAGIC, SCHEMA_VERSION, seq, sent_ns) + msgspec.msgpack.encode(
        body
    )
    match chance.randrange(12):
        case 0:
            return data[: chance.randrange(len(data) + 1)]
        case 1:
            flipped = bytearray(data)
            for _ in range(3):
                flipped[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
            return bytes(flipped)
        case 2:
            return chance.choice((b"", b"hello", b"\x91" * 5000, data[:24] + b"\x91" * 100_000))
    return data
