"""Keys of others on Zenoh: raw bytes with attachments, and liveliness tokens that are not ours.

The rules are those of `bus`: what arrives lands in a Mailbox, no work on the bus's
threads, use it as a context manager.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple, Protocol

from foretwin.contracts.bus import ZenohSession
from foretwin.contracts.callback_threads import keep_thread_state
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.setup import BusSetup


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

    def subscribe(self, key: str, mailbox: Mailbox, *, history: bool = False) -> None:
        """Let every sample on the key expression land in `mailbox` as Arrived.

        With `history` also what publishers have said before and keep for who comes later.
        """

    def put(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send one sample; never raises for a lost link, drops rather than waits."""

    def declare_alive(self, alive_key: str) -> None:
        """Hold a liveliness token until `close` or the process's end."""

    def watch_alive(self, alive_key: str, mailbox: Mailbox) -> None:
        """Let every appearance, past ones included, and every loss land in `mailbox` as Alive."""


class ZenohForeignBus(ZenohSession):
    """A client session to a router; raises BusUnreachable where there is none."""

    def __init__(self, setup: BusSetup) -> None:
        super().__init__(setup)

    @property
    def session_id(self) -> str:
        """The session's Zenoh id."""
        return str(self._session.info.zid())

    def subscribe(self, key: str, mailbox: Mailbox, *, history: bool = False) -> None:
        """Receive into `mailbox`; see ForeignBus."""

        def land(sample: Any) -> None:
            keep_thread_state()
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

        self._hear(key, land, history=history)

    def put(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send one sample; see ForeignBus."""
        publisher = self._publisher(
            key,
            priority=self._zenoh.Priority.INTERACTIVE_HIGH,
            congestion_control=self._zenoh.CongestionControl.DROP,
            express=True,
        )
        publisher.put(payload, attachment=attachment)
