"""Keys of others on Zenoh: raw bytes with attachments, and liveliness tokens that are not ours.

The rules are those of `contracts.bus`: what arrives lands in a Mailbox, no work on the bus's
threads, use it as a context manager.
"""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any, NamedTuple, Protocol, Self

from contracts.bus import BusUnreachable, zenoh_config
from contracts.mailbox import Alive, Mailbox
from contracts.setup import BusSetup


class Arrived(NamedTuple):
    """One sample on a foreign key; times are of its receipt."""

    key: str
    payload: bytes
    attachment: bytes | None
    received_mono_ns: int
    received_wall_ns: int


class ForeignBus(Protocol):
    """What a gateway needs of the bus on the other side."""

    @property
    def session_id(self) -> str:
        """The session's Zenoh id, in hexadecimal digits."""

    @property
    def connected(self) -> bool:
        """Whether a router or peer is there now."""

    def subscribe(self, key: str, mailbox: Mailbox) -> None:
        """Let every sample on the key expression land in `mailbox` as Arrived."""

    def put(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send one sample; never raises for a lost link, drops rather than waits."""

    def declare_alive(self, token: str) -> None:
        """Hold a liveliness token until `close` or the process's end."""

    def watch_alive(self, tokens: str, mailbox: Mailbox) -> None:
        """Let every appearance, past ones included, and every loss land in `mailbox` as Alive."""


class ZenohForeignBus:
    """A client session to the router at `endpoint`; raises BusUnreachable where there is none."""

    def __init__(self, endpoint: str) -> None:
        import zenoh

        self._zenoh = zenoh
        self._publishers: dict[str, Any] = {}
        self._declared: list[Any] = []
        try:
            self._session: Any = zenoh.open(zenoh_config(BusSetup(endpoint=endpoint), router=False))
        except zenoh.ZError as error:
            raise BusUnreachable(f"no Zenoh router at {endpoint}: {error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def session_id(self) -> str:
        """The session's Zenoh id."""
        return str(self._session.info.zid())

    @property
    def connected(self) -> bool:
        """Whether a router or peer is there now; an unplugged cable shows after the lease, 3 s."""
        info = self._session.info
        return bool(info.routers_zid() or info.peers_zid())

    def subscribe(self, key: str, mailbox: Mailbox) -> None:
        """Receive into `mailbox`; see ForeignBus."""

        def land(sample: Any) -> None:
            attached = sample.attachment
            mailbox.put(
                Arrived(
                    str(sample.key_expr),
                    sample.payload.to_bytes(),
                    None if attached is None else attached.to_bytes(),
                    time.monotonic_ns(),
                    time.time_ns(),
                )
            )

        self._declared.append(self._session.declare_subscriber(key, land))

    def put(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send one sample; see ForeignBus."""
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._session.declare_publisher(
                key,
                priority=self._zenoh.Priority.INTERACTIVE_HIGH,
                congestion_control=self._zenoh.CongestionControl.DROP,
                express=True,
            )
            self._publishers[key] = publisher
        publisher.put(payload, attachment=attachment)

    def declare_alive(self, token: str) -> None:
        """Hold a liveliness token; see ForeignBus."""
        self._declared.append(self._session.liveliness().declare_token(token))

    def watch_alive(self, tokens: str, mailbox: Mailbox) -> None:
        """Watch liveliness tokens; see ForeignBus."""
        put = self._zenoh.SampleKind.PUT

        def land(sample: Any) -> None:
            mailbox.put(Alive(str(sample.key_expr), sample.kind == put, time.monotonic_ns()))

        self._declared.append(
            self._session.liveliness().declare_subscriber(tokens, land, history=True)
        )

    def close(self) -> None:
        """Close the session; idempotent."""
        self._publishers.clear()
        self._declared.clear()
        if not self._session.is_closed():
            self._session.close()
