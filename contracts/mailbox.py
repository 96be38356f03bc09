"""What lies in a mailbox, and the mailbox itself: the bounded queue between the bus and a process.

Receiving never runs user code on the bus's threads: messages land in a bounded `Mailbox`, whose
owner takes them when it likes. Decoding happens on taking, so what is dropped costs nothing.
"""

from __future__ import annotations

import collections
import threading
import time
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import msgspec

from foretwin.contracts.codec import Envelope, encode, sender_of
from foretwin.contracts.guard import Refused, opened
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.trace import span

_TURNS = 20


class Received:
    """One message as it lay in the mailbox; `envelope()` decodes it."""

    __slots__ = ("_kind", "_opened", "_payload", "channel", "key", "received_mono_ns")

    def __init__(
        self, channel: str, key: str, payload: bytes | None, kind: type[msgspec.Struct]
    ) -> None:
        """`payload` is None where it was too large to be kept."""
        self.channel = channel
        self.key = key
        self.received_mono_ns = time.monotonic_ns()
        self._payload = payload
        self._kind = kind
        self._opened: Envelope[Any] | None = None

    def envelope(self) -> Envelope[Any]:
        """Return header and message; raises Refused where the guard does not let it in."""
        if self._opened is None:
            most = CHANNELS[self.channel].most_bytes
            with span("decode " + self.channel):
                self._opened = opened(self._payload, self._kind, where=self.key, most_bytes=most)
        return self._opened

    def message(self) -> Any:
        """Return the message alone; raises Refused where the guard does not let it in."""
        return self.envelope().message

    @property
    def sender(self) -> int:
        """By whose numbering it is numbered; see foretwin.contracts.codec."""
        return 0 if self._payload is None else sender_of(self._payload)


class Reply(NamedTuple):
    """The end of a request: a message, or None with the reason in `error`.

    `refused` is set where an answer came and the guard did not let it in.
    """

    channel: str
    tag: Any
    message: Any | None
    error: str | None
    received_mono_ns: int
    refused: Refused | None = None


class Request:
    """A question to answer exactly once."""

    def __init__(
        self,
        channel: str,
        key: str,
        payload: bytes | None,
        answer: Callable[[bytes | None, str], None],
    ) -> None:
        self.channel = channel
        self.key = key
        self.received_mono_ns = time.monotonic_ns()
        self._payload = payload
        self._answer = answer

    def message(self) -> Any:
        """Return the question; raises Refused where the guard does not let it in."""
        kind = CHANNELS[self.channel].kind
        return opened(self._payload, kind, where=self.key).message

    def reply(self, message: msgspec.Struct) -> None:
        """Answer."""
        with span("encode an answer"):
            data = encode(message, sent_ns=time.time_ns())
        self._answer(data, "")

    def refuse(self, reason: str) -> None:
        """Answer that it cannot be done, and why."""
        self._answer(None, reason)


class Alive(NamedTuple):
    """A process appeared (`up`) or vanished."""

    key: str
    up: bool
    received_mono_ns: int


Item = Received | Reply | Request | Alive | Any


class Mailbox:
    """A bounded queue with many writers and one reader.

    When full, `drop_oldest` forgets the oldest item and counts it, `block` makes the writer wait
    (lock step alone: nothing may block a live drive). Who waits for two waits at one, which the
    other `nudges` as something comes to it.
    """

    def __init__(
        self,
        depth: int,
        *,
        when_full: Literal["drop_oldest", "block"] = "drop_oldest",
        nudges: Mailbox | None = None,
    ) -> None:
        if depth < 1:
            raise ValueError(f"mailbox depth {depth} must be at least 1")
        self._items: collections.deque[Item] = collections.deque()
        self._depth = depth
        self._block = when_full == "block"
        lock = threading.RLock()
        self._changed = threading.Condition(lock)
        self._pressing = threading.Condition(lock)
        self._pressing_items = 0
        self._closed = self._nudged = False
        self._nudges = nudges
        self.dropped = 0

    def put(self, item: Item) -> None:
        """Add an item; after `close`, items are ignored."""
        with self._changed:
            if self._block:
                self._changed.wait_for(lambda: self._closed or len(self._items) < self._depth)
            if self._closed:
                return
            if len(self._items) >= self._depth:
                self._popped()
                self.dropped += 1
            self._items.append(item)
            self._changed.notify_all()
            if not isinstance(item, Received):
                self._pressing_items += 1
                self._pressing.notify_all()
        if self._nudges is not None:
            self._nudges.nudge()

    def nudge(self) -> None:
        """Let who waits in `take`, or comes to wait next, go on without an item."""
        with self._changed:
            self._nudged = True
            self._changed.notify_all()

    def take(self, timeout_s: float | None = 0.0) -> Item | None:
        """Return the oldest item, or None after `timeout_s` (None waits for ever) or `close`."""
        with self._changed:
            if not self._items and timeout_s != 0.0:
                self._changed.wait_for(
                    lambda: bool(self._items) or self._closed or self._nudged, timeout_s
                )
                self._nudged = False
            if not self._items:
                return None
            item = self._popped()
            self._changed.notify_all()
            return item

    def _popped(self) -> Item:
        item = self._items.popleft()
        self._pressing_items -= not isinstance(item, Received)
        return item

    def gather(self, most_s: float) -> None:
        """Let messages come for a while, to be taken in a portion: waking up for each one costs
        more than what most of them are about. An answer or a question ends it, and `close`.
        """
        with self._changed:
            self._pressing.wait_for(lambda: self._closed or self._pressing_items > 0, most_s)

    def take_last(self, quiet_s: float) -> Item | None:
        """Return the oldest item, or None once nothing has come for `quiet_s`.

        Waited for in turns: where a machine is so busy that threads with messages in their hands
        do not get to run, ours does not either, and waits the longer.
        """
        for _ in range(_TURNS):
            if (item := self.take(quiet_s / _TURNS)) is not None:
                return item
        return None

    def close(self) -> None:
        """Wake everyone; later items are ignored."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
            self._pressing.notify_all()

    def __len__(self) -> int:
        return len(self._items)
