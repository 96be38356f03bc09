"""The one guard at the boundary: what comes from outside is a message within bounds, or refused.

Whatever a bus, a log or ROS 2 brings passes `admit`; bytes from the bus pass `opened`, which
decodes them before. Nothing but `Refused` is raised for what others sent.
"""

from __future__ import annotations

import functools
import math
import sys
from typing import Any, NamedTuple, TypeVar

import msgspec
import numpy as np

from foretwin.contracts.bounds import (
    ALL_OR_NONE,
    FAR,
    IDENTIFIERS,
    MAY_BE_UNKNOWN,
    MOST_BYTES,
    MOST_IDENTIFIER,
    MOST_INTEGER,
    MOST_TEXT,
    MOST_USERS,
    ONE_OF,
    ROAD_USER,
    SHAPES,
)
from foretwin.contracts.codec import Envelope, Header, SchemaMismatch, decode, header_of
from foretwin.contracts.drive import RoadUser, RoadUsers

Message = TypeVar("Message")


class Refused(SchemaMismatch):
    """Something from outside that cannot be used.

    `sender` is the key or file that it came by, `reason` a few words that do not vary with its
    numbers, so that refusals can be counted by it; `header` is what stood before a message of this
    schema.
    """

    def __init__(
        self, sender: str, reason: str, detail: str = "", *, header: Header | None = None
    ) -> None:
        super().__init__(f"{sender}: {detail or reason}", kind=reason)
        self.sender, self.reason, self.header = sender, reason, header


class Admitted(NamedTuple):
    """A message within bounds, and how many road users had to be left out of it."""

    message: Any
    left_out: int = 0


class _Unfit(Exception):  # noqa: N818
    """Why a value cannot be used: the reason to count by, and all of it."""

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(detail)
        self.reason = reason


def opened(
    data: bytes | None, kind: type[Message], *, where: str, most_bytes: int = MOST_BYTES
) -> Envelope[Message]:
    """Return the message in `data` (None: it was too large to be kept), within bounds.

    `where` is the key by which it came. Raises Refused.
    """
    if "*" in where:
        # Zenoh lets one sample be sent to many keys at once; nobody of ours does.
        raise Refused(where, "sent to many keys at once")
    if data is None or len(data) > most_bytes:
        raise Refused(where, "too large", f"more than {most_bytes} bytes")
    try:
        envelope = decode(data, kind, where=where)
    except SchemaMismatch as error:
        raise Refused(
            where, error.kind, str(error).removeprefix(f"{where}: "), header=_header(data)
        ) from error
    try:
        message, left_out = admit(envelope.message, where=where)
    except Refused as refused:
        refused.header = Header(envelope.seq, envelope.sent_ns)
        raise
    return envelope._replace(message=message, left_out=left_out) if left_out else envelope


def kept(payload: Any, most_bytes: int = MOST_BYTES) -> bytes | None:
    """Return the bytes of a payload of the bus, None where they are too many to be kept."""
    data: bytes | None = payload.to_bytes() if len(payload) <= most_bytes else None
    return data


def reason_in(payload: Any) -> str:
    """Return the line that says why a question was refused."""
    return (kept(payload, MOST_TEXT) or b"a reason too long to be told").decode(errors="replace")


def admit(message: Any, *, where: str) -> Admitted:
    """Return a message whose types hold, with numbers within bounds and arrays that fit each other.

    Of road users those that cannot be are left out and counted. Raises Refused.
    """
    if isinstance(message, RoadUsers):
        if len(message.users) > MOST_USERS:
            raise Refused(where, "too many road users", f"{len(message.users)} road users")
        known = tuple(user for user in message.users if is_road_user(user))
        left_out = len(message.users) - len(known)
        if left_out:
            message = msgspec.structs.replace(message, users=known)
        _check_or_refuse(message.stamp_ns, "stamp_ns", where, message)
        return Admitted(message, left_out)
    _check_or_refuse(message, "", where, message)
    return Admitted(message)


def is_road_user(user: RoadUser) -> bool:
    """Whether a road user's numbers can be those of one."""
    position = user.position
    return (
        abs(position.lat_deg) <= FAR["lat_deg"]
        and abs(position.lon_deg) <= FAR["lon_deg"]
        and abs(position.alt_m) <= FAR["m"]
        and all(low <= getattr(user, name) <= high for name, (low, high) in ROAD_USER.items())
        and len(user.user_id) <= MOST_IDENTIFIER
    )


def is_identifier(text: str) -> bool:
    """Whether a text can name a World or a process: it is part of file names and of keys."""
    return (
        0 < len(text) <= MOST_IDENTIFIER
        and text.isprintable()
        and not text.startswith(".")
        and not any(c in text for c in "/\\*$#?{} ")
    )


def _header(data: bytes) -> Header | None:
    try:
        return header_of(data, where="")
    except SchemaMismatch:
        return None


def _check_or_refuse(value: Any, name: str, where: str, message: Any) -> None:
    try:
        _check(value, name, finite=True)
    except _Unfit as unfit:
        raise Refused(
            where, f"{type(message).__name__}: {unfit.reason}", f"{type(message).__name__}: {unfit}"
        ) from None


def _check(value: Any, name: str, *, finite: bool) -> None:
    """Raise _Unfit where a value, or one within it, is out of bounds; `name` is its field's."""
    match value:
        case bool() | None | bytes() | msgspec.Raw():
            return
        case float():
            _check_number(value, name, finite=finite)
        case int():
            if abs(value) > MOST_INTEGER:
                raise _Unfit(f"{name} out of bounds", f"{name} {value} is out of bounds")
        case str():
            _check_text(value, name)
        case np.ndarray():
            _check_array(value, name, finite=finite)
        case msgspec.Struct():
            kind = type(value)
            finite = finite and kind not in MAY_BE_UNKNOWN
            for field, far, words in _fields(kind):
                one = getattr(value, field)
                if one is None or _fits(one, far):
                    continue  # most do
                _check(one, field, finite=finite)
                if words:
                    _check_word(one, field, words)
            if kind in ALL_OR_NONE or kind in SHAPES:
                _check_together(value, kind)
        case tuple() | list():
            for one in value:
                _check(one, name, finite=finite)
        case dict():
            for key, one in value.items():
                _check(key, name, finite=finite)
                _check(one, name, finite=finite)


def _fits(value: Any, far: float) -> bool:
    """Whether a value is a plain number within its bound, or some, or a truth; NaN is not."""
    kind = type(value)
    if kind is float:
        return bool(-far <= value <= far)
    if kind is int:
        return bool(-MOST_INTEGER <= value <= MOST_INTEGER)
    if kind is tuple:
        for one in value:  # noqa: SIM110  a generator costs more than all it looks at
            if type(one) is not float or not -far <= one <= far:
                return False
        return True
    return kind is bool


@functools.cache
def _fields(kind: type[msgspec.Struct]) -> tuple[tuple[str, float, frozenset[str] | None], ...]:
    """Return each field of a message with its bound, finite in any case, and its words."""
    return tuple(
        (name, min(_far(name), sys.float_info.max), ONE_OF.get((kind, name)))
        for name in kind.__struct_fields__
    )


def _far(name: str) -> float:
    return FAR.get(name) or FAR.get(name.rsplit("_", 1)[-1], math.inf)


def _check_number(value: float, name: str, *, finite: bool) -> None:
    if not math.isfinite(value):
        if finite:
            raise _Unfit(f"{name} not finite", f"{name} is {value}")
    elif abs(value) > _far(name):
        raise _Unfit(f"{name} out of bounds", f"{name} {value:g} is beyond ±{_far(name):g}")


def _check_array(value: np.ndarray[Any, Any], name: str, *, finite: bool) -> None:
    if not finite or not value.size:
        return
    if value.dtype.kind != "f":
        raise _Unfit(f"{name} no array of floats", f"{name} is an array of {value.dtype}")
    most = float(np.abs(value).max())  # NaN where one is
    if not math.isfinite(most):
        raise _Unfit(f"{name} not finite", f"{name} holds a number that is not finite")
    _check_number(most, name, finite=True)


def _check_text(value: str, name: str) -> None:
    if name in IDENTIFIERS:
        if not is_identifier(value):
            raise _Unfit(f"{name} malformed", f"{name} {value[:40]!r} is no plain name")
    elif len(value) > MOST_TEXT:
        raise _Unfit(f"{name} too long", f"{name} of {len(value)} characters")


def _check_word(value: str, name: str, words: frozenset[str]) -> None:
    if value not in words:
        raise _Unfit(f"{name} unknown", f"{name} {value[:40]!r} is none of those known")


def _check_together(value: msgspec.Struct, kind: type[msgspec.Struct]) -> None:
    names = ALL_OR_NONE.get(kind, ())
    if len({getattr(value, name) is None for name in names}) > 1:
        raise _Unfit(f"{names[0]} incomplete", f"of {', '.join(names)} one alone is missing")
    if kind in SHAPES:
        _check_shapes(value, SHAPES[kind])


def _check_shapes(message: msgspec.Struct, shapes: dict[str, str]) -> None:
    sizes: dict[str, int] = {}
    for path, words in shapes.items():
        for value in _values_at(message, path):
            shape = value.shape if isinstance(value, np.ndarray) else (len(value),)
            wanted = words.rstrip("?").split()
            if words.endswith("?") and shape == (0,):
                continue
            fits = len(shape) == len(wanted) and all(
                size == (int(word) if word.isdigit() else sizes.setdefault(word, size))
                for word, size in zip(wanted, shape, strict=True)
            )
            if not fits:
                raise _Unfit(
                    f"{path} of another shape",
                    f"{path} has shape {shape}; ({', '.join(wanted)}) would fit "
                    f"where {', '.join(f'{word} is {size}' for word, size in sizes.items())}",
                )


def _values_at(message: Any, path: str) -> list[Any]:
    first, _, rest = path.partition(".")
    if first == "*":
        return list(message.values())
    value = getattr(message, first)
    return _values_at(value, rest) if rest else [value]
