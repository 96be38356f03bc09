"""The link between a worker and the process of a planner that is not foretwin's own: frames.

A frame is its kind (one byte), the length of its body (8 bytes, little-endian) and the body. What
goes to the planner's process is pickled: it is foretwin's own. What comes back is not.
"""

from __future__ import annotations

import pickle
import socket
import struct
import time
from typing import Any, NamedTuple

import msgspec
import numpy as np

from foretwin.sim_worker.planner_interface import PlannerOutput, PlannerView

READY, QUESTION, ANSWER, FAILURE = b"R", b"Q", b"A", b"F"
_HEADER = struct.Struct("<cQ")
_MAX_ANSWER_BYTES = 1 << 24
SHARED = ("path", "vehicle", "ground", "car_plan")
"""Of a view, what stays the same throughout a job."""


class LinkLost(ConnectionError):  # noqa: N818
    """The other side has closed the link."""


class Frame(NamedTuple):
    """One message."""

    kind: bytes
    body: bytes


def send(link: socket.socket, kind: bytes, body: bytes, *, within_s: float | None = None) -> None:
    """Send one frame; raises TimeoutError or ConnectionError."""
    link.settimeout(within_s)
    link.sendall(_HEADER.pack(kind, len(body)))
    link.sendall(body)


def receive(link: socket.socket, *, within_s: float | None = None) -> Frame:
    """Return the next frame; raises TimeoutError, LinkLost, or ValueError for one too long."""
    end = None if within_s is None else time.monotonic() + within_s
    kind, length = _HEADER.unpack(_exactly(link, _HEADER.size, end))
    if end is not None and length > _MAX_ANSWER_BYTES:
        raise ValueError(f"an answer of {length} bytes")
    return Frame(kind, bytes(_exactly(link, length, end)))


def _exactly(link: socket.socket, count: int, end: float | None) -> bytearray:
    data = bytearray(count)
    view = memoryview(data)
    while len(view):
        if end is not None:
            left = end - time.monotonic()
            if left <= 0.0:
                raise TimeoutError
            link.settimeout(left)
        else:
            link.settimeout(None)
        got = link.recv_into(view)
        if not got:
            raise LinkLost("the link was closed")
        view = view[got:]
    return data


class Question(NamedTuple):
    """One control tick; `begins` is the number of cars where a job begins with it, else 0.

    `shared` holds what stays the same throughout a job and is None in `view`, by its fields; None
    where it was sent already.
    """

    begins: int
    shared: dict[str, Any] | None
    view: PlannerView


def pack_question(view: PlannerView, *, begins: int, with_shared: bool) -> bytes:
    """Return a question's bytes."""
    shared = {name: getattr(view, name) for name in SHARED} if with_shared else None
    nothing: dict[str, Any] = dict.fromkeys(SHARED)
    question = Question(begins, shared, view._replace(**nothing))
    return pickle.dumps(question, protocol=pickle.HIGHEST_PROTOCOL)


def read_question(body: bytes) -> Question:
    """Return a question from its bytes, which must be foretwin's own."""
    question: Question = pickle.loads(body)
    return question


def pack_answer(answer: PlannerOutput, remarks: dict[int, str]) -> bytes:
    """Return an answer's bytes; raises ValueError for what is no row of numbers."""
    try:
        accel, angle = (np.asarray(one, dtype=np.float64) for one in answer)
    except (TypeError, ValueError):
        wanted = "a PlannerOutput of accel_mps2 and tire_angle_rad"
        raise ValueError(f"answers {type(answer).__name__}, not {wanted}") from None
    if accel.ndim != 1 or accel.shape != angle.shape:
        raise ValueError(f"answers of shapes {accel.shape} and {angle.shape}")
    words = {int(row): str(said) for row, said in remarks.items()}
    return msgspec.msgpack.encode((accel.tobytes(), angle.tobytes(), words))


def read_answer(body: bytes) -> tuple[PlannerOutput, dict[int, str]]:
    """Return an answer and its remarks; raises ValueError where there is none in the bytes."""
    try:
        *columns, remarks = msgspec.msgpack.decode(body, type=tuple[bytes, bytes, dict[int, str]])
        accel, angle = (np.frombuffer(column).copy() for column in columns)
    except (msgspec.DecodeError, ValueError) as error:
        raise ValueError(f"no answer in {len(body)} bytes: {error}") from error
    return PlannerOutput(accel, angle), remarks
