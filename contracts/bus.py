"""The bus: publish, subscribe, ask, serve and watch over Zenoh.

What arrives lands in a `foretwin.contracts.mailbox.Mailbox`.
"""

from __future__ import annotations

import collections
import itertools
import json
import threading
import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any, Protocol, Self

import msgspec

from foretwin.contracts.codec import encode
from foretwin.contracts.guard import Refused, kept, opened, reason_in
from foretwin.contracts.keys import CHANNELS, Qos
from foretwin.contracts.keys import key as channel_key
from foretwin.contracts.mailbox import Alive, Item, Mailbox, Received, Reply, Request
from foretwin.contracts.setup import BusSetup

__all__ = [
    "Alive",
    "Bus",
    "BusUnreachable",
    "Item",
    "Mailbox",
    "Received",
    "Reply",
    "Request",
    "ZenohBus",
    "ZenohSession",
    "ask",
    "zenoh_config",
]


CONNECT_S = 5.0
"""How long a client looks for its router."""
LEASE_MS = 3000
"""A process that is silent for so long counts as lost."""
LOSSLESS_LEASE_MS = 60_000
LOSSLESS_WAIT_US = 600_000_000
"""How long a writer waits for a reader that stands still where nothing may be lost."""


_QUEUE_SIZES = {
    **dict.fromkeys(("real_time", "interactive_high", "data_high", "data"), 16),
    "interactive_low": 4,
    **dict.fromkeys(("control", "data_low", "background"), 2),
}
"""Batches that may wait to be sent, by priority; docs/bus.md."""


class BusUnreachable(ConnectionError):  # noqa: N818
    """No router answers at the endpoint."""


class Bus(Protocol):
    """What processes need of a bus; `ids` are those of `foretwin.contracts.keys.key`."""

    def publish(self, channel: str, message: msgspec.Struct, **ids: str) -> None:
        """Send one message; never raises for a lost link."""

    def subscribe(self, channel: str, mailbox: Mailbox, **ids: str) -> None:
        """Let every message of the channel land in `mailbox` as Received."""

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
        """Ask; exactly one Reply lands in `mailbox`, also when nobody answers."""

    def serve(self, channel: str, mailbox: Mailbox, **ids: str) -> None:
        """Let every question on the channel land in `mailbox` as Request."""

    def declare_alive(self, alive_key: str) -> None:
        """Hold a liveliness token until `close` or the process's end."""

    def watch_alive(self, alive_key: str, mailbox: Mailbox) -> None:
        """Let every appearance, past ones included, and every loss land in `mailbox` as Alive."""

    def close(self) -> None:
        """Undeclare everything."""


def ask(
    bus: Bus, channel: str, message: msgspec.Struct, *, timeout_s: float = 10.0, **ids: str
) -> Any:
    """Ask and return the answer; raises TimeoutError with the reason where there is none."""
    mailbox = Mailbox(1)
    bus.request(channel, message, mailbox, timeout_s=timeout_s, **ids)
    reply = mailbox.take(timeout_s + 1.0)
    if not isinstance(reply, Reply) or reply.message is None:
        reason = reply.error if isinstance(reply, Reply) else "no reply"
        raise TimeoutError(f"{channel_key(channel, **ids)}: {reason}")
    return reply.message


def zenoh_config(setup: BusSetup, *, router: bool) -> Any:
    """Return the Zenoh configuration; docs/bus.md gives the reason for each setting."""
    import zenoh

    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": "router" if router else "client",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "timestamping/enabled": True,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LOSSLESS_LEASE_MS if setup.lossless else LEASE_MS,
        "transport/link/tx/queue/size": _QUEUE_SIZES,
        "listen/endpoints": [setup.endpoint] if router else [],
    }
    if setup.lossless:
        queue = "transport/link/tx/queue/congestion_control/block"
        settings[f"{queue}/wait_before_close"] = LOSSLESS_WAIT_US
    if not router:
        settings["connect/endpoints"] = [setup.endpoint]
        settings["connect/timeout_ms"] = round(1e3 * CONNECT_S)
        retry = {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2}
        settings["connect/retry"] = retry
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    return config


class ZenohSession:
    """One Zenoh session, and what every bus does with it; use it as a context manager.

    Unclosed, it hangs at exit. Raises BusUnreachable where a client finds no router.
    """

    def __init__(self, setup: BusSetup, *, router: bool = False) -> None:
        import zenoh

        self._zenoh = zenoh
        self._publishers: dict[str, Any] = {}
        self._declared: list[Any] = []
        try:
            self._session: Any = zenoh.open(zenoh_config(setup, router=router))
        except zenoh.ZError as error:
            raise BusUnreachable(f"no Zenoh router at {setup.endpoint}: {error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def declare_alive(self, alive_key: str) -> None:
        """Hold a liveliness token; see Bus."""
        self._declared.append(self._session.liveliness().declare_token(alive_key))

    def watch_alive(self, alive_key: str, mailbox: Mailbox) -> None:
        """Watch liveliness tokens; see Bus."""
        put = self._zenoh.SampleKind.PUT

        def land(sample: Any) -> None:
            mailbox.put(Alive(str(sample.key_expr), sample.kind == put, time.monotonic_ns()))

        self._declared.append(
            self._session.liveliness().declare_subscriber(alive_key, land, history=True)
        )

    def _hear(self, key: str, land: Callable[[Any], None], *, history: bool) -> None:
        """Call `land` with each sample; with `history` also with what publishers have kept."""
        if history:
            from zenoh import ext

            kept = ext.HistoryConfig(detect_late_publishers=True)
            heard = ext.declare_advanced_subscriber(self._session, key, land, history=kept)
        else:
            heard = self._session.declare_subscriber(key, land)
        self._declared.append(heard)

    def _publisher(self, key: str, **qos: Any) -> Any:
        if key not in self._publishers:
            self._publishers[key] = self._session.declare_publisher(key, **qos)
        return self._publishers[key]

    def close(self) -> None:
        """Close the session; idempotent."""
        self._publishers.clear()
        self._declared.clear()
        if not self._session.is_closed():
            self._session.close()


class ZenohBus(ZenohSession):
    """The bus over one Zenoh session; see ZenohSession."""

    def __init__(self, setup: BusSetup, *, router: bool = False) -> None:
        super().__init__(setup, router=router)
        self._lossless = setup.lossless
        self._sent: dict[str, Iterator[int]] = collections.defaultdict(itertools.count)
        """The next sequence number of each key."""
        self._lock = threading.Lock()

    def _qos(self, qos: Qos) -> dict[str, Any]:
        control = self._zenoh.CongestionControl
        return {
            "priority": getattr(self._zenoh.Priority, qos.priority.upper()),
            "congestion_control": control.BLOCK if qos.block or self._lossless else control.DROP,
            "express": qos.express,
        }

    def _encoded(self, full_key: str, message: msgspec.Struct) -> bytes:
        with self._lock:
            seq = next(self._sent[full_key])
        return encode(message, seq=seq, sent_ns=time.time_ns())

    def publish(self, channel: str, message: msgspec.Struct, **ids: str) -> None:
        """Send one message; see Bus."""
        full_key = channel_key(channel, **ids)
        with self._lock:
            publisher = self._publisher(full_key, **self._qos(CHANNELS[channel].qos))
        publisher.put(self._encoded(full_key, message))

    def subscribe(self, channel: str, mailbox: Mailbox, **ids: str) -> None:
        """Receive into `mailbox`; see Bus."""
        kind, most = CHANNELS[channel].kind, CHANNELS[channel].most_bytes

        def land(sample: Any) -> None:
            data = kept(sample.payload, most)
            mailbox.put(Received(channel, str(sample.key_expr), data, kind))

        self._declared.append(self._session.declare_subscriber(channel_key(channel, **ids), land))

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
                finish(opened(kept(reply.ok.payload), kind, where=full_key).message, None)
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
