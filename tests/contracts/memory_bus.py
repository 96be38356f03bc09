"""The bus in one process: same calls, same mailboxes, no network."""

from __future__ import annotations

import threading
import time
import weakref
from typing import Any

import msgspec

from foretwin.contracts.codec import encode
from foretwin.contracts.guard import Refused, opened
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.keys import key as channel_key
from foretwin.contracts.mailbox import Alive, Mailbox, Received, Reply, Request


def _matches(pattern: str, full_key: str) -> bool:
    parts, words = pattern.split("/"), full_key.split("/")
    return len(parts) == len(words) and all(
        part in ("*", word) for part, word in zip(parts, words, strict=True)
    )


class MemoryBus:
    """Delivers at once, in the publisher's thread; share one object between all sides."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._subscribers: list[tuple[str, str, Mailbox]] = []
        self._servers: dict[str, Mailbox] = {}
        self._alive: set[str] = set()
        self._watchers: list[tuple[str, Mailbox]] = []
        self._seq: dict[str, int] = {}
        self.goes_on_as: list[object] = []
        """Whose place it has taken."""
        self.recovered: list[str] = []
        """Keys that were asked for once more."""

    def publish(self, channel: str, message: msgspec.Struct, **ids: str) -> None:
        """Send one message; see Bus."""
        full_key = channel_key(channel, **ids)
        with self._lock:
            seq = self._seq.get(full_key, 0)
            self._seq[full_key] = seq + 1
            receivers = [
                box for pattern, _, box in self._subscribers if _matches(pattern, full_key)
            ]
        data = encode(message, seq=seq, sent_ns=time.time_ns())
        for mailbox in receivers:
            mailbox.put(Received(channel, full_key, data, CHANNELS[channel].kind))

    def go_on_as(self, other: object) -> None:
        """Take another session's place; see Bus."""
        self.goes_on_as.append(other)

    def subscribe(
        self, channel: str, mailbox: Mailbox, *, recover: bool = False, **ids: str
    ) -> None:
        """Receive into `mailbox`; see Bus."""
        with self._lock:
            self._subscribers.append((channel_key(channel, **ids), channel, mailbox))

    def mailboxes(self, channel: str) -> list[Mailbox]:
        """Return where messages of a channel land, for a message that is not the next one."""
        return [box for _, name, box in self._subscribers if name == channel]

    def recover(self, channel: str, **ids: str) -> None:
        """Note who asks; nothing is lost here. See Bus."""
        self.recovered.append(channel_key(channel, **ids))

    def request(
        self,
        channel: str,
        message: msgspec.Struct,
        mailbox: Mailbox,
        *,
        tag: Any = None,
        timeout_s: float = 10.0,
        **ids: str,
    ) -> None:
        """Ask; a question nobody serves is answered at once with an error."""
        full_key = channel_key(channel, **ids)
        kind = CHANNELS[channel].reply
        if kind is None:
            raise ValueError(f"channel {channel!r} takes no questions")
        server = self._servers.get(full_key)
        answered = threading.Event()

        def answer(data: bytes | None, reason: str) -> None:
            if answered.is_set():
                return
            answered.set()
            reply: Any | None = None
            error: str | None = reason
            refused: Refused | None = None
            if data is not None:
                try:
                    reply, error = opened(data, kind, where=full_key).message, None
                except Refused as problem:
                    error, refused = str(problem), problem
            mailbox.put(Reply(channel, tag, reply, error, time.monotonic_ns(), refused))

        if server is None:
            answer(None, "no answer")
            return
        question = Request(channel, full_key, encode(message), answer)
        # Forgotten without an answer, as by a full mailbox: over Zenoh too the asker hears of it.
        weakref.finalize(question, answer, None, "no answer").atexit = False
        server.put(question)

    def serve(self, channel: str, mailbox: Mailbox, **ids: str) -> None:
        """Answer questions; see Bus."""
        self._servers[channel_key(channel, **ids)] = mailbox

    def declare_alive(self, alive_key: str) -> None:
        """Hold a liveliness token; see Bus."""
        self._set_alive(alive_key, up=True)

    def lose(self, alive_key: str) -> None:
        """Let a token vanish, as a killed process would."""
        self._set_alive(alive_key, up=False)

    def _set_alive(self, alive_key: str, *, up: bool) -> None:
        with self._lock:
            (self._alive.add if up else self._alive.discard)(alive_key)
            watchers = [box for pattern, box in self._watchers if _matches(pattern, alive_key)]
        for mailbox in watchers:
            mailbox.put(Alive(alive_key, up, time.monotonic_ns()))

    @property
    def connected(self) -> bool:
        return True

    def watch_alive(self, alive_key: str, mailbox: Mailbox) -> None:
        """Watch liveliness tokens; see Bus."""
        with self._lock:
            self._watchers.append((alive_key, mailbox))
            known = [full_key for full_key in self._alive if _matches(alive_key, full_key)]
        for full_key in sorted(known):
            mailbox.put(Alive(full_key, True, time.monotonic_ns()))

    def close(self) -> None:
        """Forget everything."""
        with self._lock:
            self._subscribers.clear()
            self._servers.clear()
            self._watchers.clear()
