"""The bus: publish, subscribe, ask, serve and watch over Zenoh.

What arrives lands in a `foretwin.contracts.mailbox.Mailbox`.
"""

from __future__ import annotations

import collections
import functools
import itertools
import secrets
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Self

import msgspec

from foretwin.contracts.bus_calls import Bus, ask
from foretwin.contracts.callback_threads import keep_thread_state
from foretwin.contracts.codec import MOST_SENDER, encode
from foretwin.contracts.guard import Refused, kept, opened, reason_in
from foretwin.contracts.kept import (
    SentLately,
    ask_for_kept,
    keeping_publisher,
    most_kept,
    recovering_subscriber,
)
from foretwin.contracts.keys import CHANNELS, Qos
from foretwin.contracts.keys import key as channel_key
from foretwin.contracts.lives import Lives, key_of_life, new_life
from foretwin.contracts.mailbox import Alive, Mailbox, Received, Reply, Request
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.trace import span
from foretwin.contracts.zenoh_config import zenoh_config

__all__ = [
    "Alive",
    "Bus",
    "BusUnreachable",
    "Mailbox",
    "Received",
    "Reply",
    "Request",
    "ZenohBus",
    "ZenohSession",
    "ask",
]


class BusUnreachable(ConnectionError):  # noqa: N818
    """No router answers at the endpoint."""


class ZenohSession:
    """One Zenoh session, and what every bus does with it; use it as a context manager.

    Unclosed, it hangs at exit. Raises BusUnreachable where a client finds no router.
    """

    def __init__(self, setup: BusSetup, *, router: bool = False) -> None:
        import zenoh
        import zenoh.ext

        self._zenoh = zenoh
        self._publishers: dict[str, Any] = {}
        self._declared: list[Any] = []
        try:
            self._session: Any = zenoh.open(zenoh_config(setup, router=router))
        except zenoh.ZError as error:
            raise BusUnreachable(
                f"no Zenoh router at {setup.endpoint}: {_why(setup, router) or error}"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def declare_alive(self, alive_key: str) -> None:
        """Hold a liveliness token; see Bus."""
        self._declared.append(self._session.liveliness().declare_token(alive_key))

    def watch_alive(self, alive_key: str, mailbox: Mailbox) -> None:
        """Watch liveliness tokens; see Bus."""
        self._watch_tokens(alive_key, mailbox.put)

    def _watch_tokens(self, tokens: str, land: Callable[[Alive], None]) -> None:
        put = self._zenoh.SampleKind.PUT

        def heard(sample: Any) -> None:
            land(Alive(str(sample.key_expr), sample.kind == put, time.monotonic_ns()))

        self._declared.append(
            self._session.liveliness().declare_subscriber(tokens, heard, history=True)
        )

    def _hear(self, key: str, land: Callable[[Any], None], *, history: bool) -> None:
        """Call `land` with each sample; with `history` also with what publishers have kept."""
        if history:
            ext = self._zenoh.ext
            kept = ext.HistoryConfig(detect_late_publishers=True)
            heard = ext.declare_advanced_subscriber(self._session, key, land, history=kept)
        else:
            heard = self._session.declare_subscriber(key, land)
        self._declared.append(heard)

    def _publisher(self, key: str, *, samples: int = 0, **qos: Any) -> Any:
        """Return the publisher of a key, which keeps its last `samples` for who missed them."""
        if key not in self._publishers:
            self._publishers[key] = (
                keeping_publisher(self._zenoh, self._session, key, samples=samples, **qos)
                if samples
                else self._session.declare_publisher(key, **qos)
            )
        return self._publishers[key]

    @property
    def connected(self) -> bool:
        """Whether a router or peer is there now; see Bus."""
        info = self._session.info
        return bool(info.routers_zid() or info.peers_zid())

    def close(self) -> None:
        """Close the session; idempotent."""
        self._publishers.clear()
        self._declared.clear()
        if not self._session.is_closed():
            self._session.close()


def _why(setup: BusSetup, router: bool) -> str:
    """Return why a client with a certificate is refused, as far as that can be found out."""
    if setup.tls is None or router:
        return ""
    from foretwin.contracts.why_refused import ADMITTED, likely_causes

    return "; ".join(likely_causes(setup)) or ADMITTED


class ZenohBus(ZenohSession):
    """The bus over one Zenoh session; see ZenohSession."""

    def __init__(self, setup: BusSetup, *, router: bool = False) -> None:
        super().__init__(setup, router=router)
        self._lossless = setup.lossless
        self._sent: dict[str, Iterator[int]] = collections.defaultdict(itertools.count)
        """The next sequence number of each key."""
        self._recovering: dict[str, Callable[[], None]] = {}
        """Asks for what is kept of a key, by key."""
        self._lately: SentLately | None = None
        self._sender = 1 + secrets.randbelow(MOST_SENDER)
        self._lock = threading.Lock()

    def go_on_as(self, other: object) -> None:
        """Take another session's place, or be the first of several; see RedialledBus."""
        if isinstance(other, ZenohBus) and other._lately is not None:
            self._sender, self._sent, self._lately = other._sender, other._sent, other._lately
            self._declared += self._lately.answers(self._session)
        else:
            self._lately = SentLately()

    def declare_alive(self, alive_key: str) -> None:
        """Hold a liveliness token; see Bus."""
        super().declare_alive(key_of_life(alive_key, new_life()))

    def watch_alive(self, alive_key: str, mailbox: Mailbox) -> None:
        """Watch liveliness tokens; see Bus."""
        lives = Lives()

        def land(token: Alive) -> None:
            if (word := lives.take(token.key, up=token.up)) is not None:
                mailbox.put(token._replace(key=word.alive_key, up=word.up))

        self._watch_tokens(key_of_life(alive_key, "**"), land)

    def _qos(self, qos: Qos) -> dict[str, Any]:
        control = self._zenoh.CongestionControl
        return {
            "priority": getattr(self._zenoh.Priority, qos.priority.upper()),
            "congestion_control": control.BLOCK if qos.block or self._lossless else control.DROP,
            "express": qos.express,
        }

    def _most_kept(self, channel: str) -> int:
        """Return how many samples of a channel are kept; where nobody drops any, none."""
        return 0 if self._lossless else most_kept(CHANNELS[channel])

    def _encoded(self, full_key: str, message: msgspec.Struct) -> bytes:
        with self._lock:
            seq = next(self._sent[full_key])
        return encode(message, seq=seq, sent_ns=time.time_ns(), sender=self._sender)

    def publish(self, channel: str, message: msgspec.Struct, **ids: str) -> None:
        """Send one message; see Bus."""
        full_key = channel_key(channel, **ids)
        publisher = self._publishers.get(full_key)
        if publisher is None:
            samples, qos = self._most_kept(channel), self._qos(CHANNELS[channel].qos)
            with self._lock:
                publisher = self._publisher(full_key, samples=samples, **qos)
        with span("publish " + channel):
            data = self._encoded(full_key, message)
            if self._lately is not None:
                self._lately.add(CHANNELS[channel], full_key, data)
            publisher.put(data)

    def subscribe(
        self, channel: str, mailbox: Mailbox, *, recover: bool = False, **ids: str
    ) -> None:
        """Receive into `mailbox`; see Bus."""
        kind, most = CHANNELS[channel].kind, CHANNELS[channel].most_bytes
        full_key = channel_key(channel, **ids)
        samples = self._most_kept(channel) if recover else 0

        def land(sample: Any) -> None:
            keep_thread_state()
            data = kept(sample.payload, most)
            mailbox.put(Received(channel, str(sample.key_expr), data, kind))

        if not samples:
            # To wake a thread of its own, Zenoh's usual way, costs more than to put a sample into
            # the mailbox. Not so below: there Zenoh holds a lock while it calls.
            at_once = self._zenoh.handlers.Callback(land, indirect=False)
            self._declared.append(self._session.declare_subscriber(full_key, at_once))
            return
        self._declared.append(recovering_subscriber(self._zenoh, self._session, full_key, land))
        self._recovering[full_key] = functools.partial(
            ask_for_kept, self._zenoh, self._session, full_key, land, samples=samples
        )
        self._recovering[full_key]()

    def recover(self, channel: str, **ids: str) -> None:
        """Ask again for what is kept of a channel; see Bus."""
        ask = self._recovering.get(channel_key(channel, **ids))
        if ask is not None:
            ask()

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
        """Ask; see Bus."""
        kind = CHANNELS[channel].reply
        if kind is None:
            raise ValueError(f"channel {channel!r} takes no questions")
        full_key = channel_key(channel, **ids)
        answered = threading.Event()

        def finish(reply: Any | None, error: str | None, refused: Refused | None = None) -> None:
            if not answered.is_set():
                answered.set()
                mailbox.put(Reply(channel, tag, reply, error, time.monotonic_ns(), refused))

        def land(reply: Any) -> None:
            if reply.ok is None:
                finish(None, reason_in(reply.err.payload))
                return
            try:
                with span("decode an answer", bytes=len(reply.ok.payload)):
                    message = opened(kept(reply.ok.payload), kind, where=full_key).message
                finish(message, None)
            except Refused as refused:
                finish(None, str(refused), refused)

        self._session.get(
            full_key,
            self._zenoh.handlers.Callback(land, lambda: finish(None, "no answer"), indirect=False),
            payload=self._encoded(full_key, message),
            timeout=timeout_s,
            **self._qos(CHANNELS[channel].qos),
        )

    def serve(self, channel: str, mailbox: Mailbox, **ids: str) -> None:
        """Answer questions; see Bus."""
        full_key = channel_key(channel, **ids)

        def land(query: Any) -> None:
            def answer(data: bytes | None, reason: str) -> None:
                with query:
                    if data is None:
                        query.reply_err(reason.encode())
                    else:
                        query.reply(full_key, data)

            payload = b"" if query.payload is None else kept(query.payload)
            mailbox.put(Request(channel, full_key, payload, answer))

        self._declared.append(self._session.declare_queryable(full_key, land, complete=True))
