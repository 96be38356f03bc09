"""What processes ask of a bus, whatever carries it: Zenoh, or memory in tests."""

from __future__ import annotations

from typing import Any, Protocol

import msgspec

from foretwin.contracts.keys import key as channel_key
from foretwin.contracts.mailbox import Mailbox, Reply


class Bus(Protocol):
    """What processes need of a bus; `ids` are those of `foretwin.contracts.keys.key`."""

    def publish(self, channel: str, message: msgspec.Struct, **ids: str) -> None:
        """Send one message; never raises for a lost link."""

    def subscribe(
        self, channel: str, mailbox: Mailbox, *, recover: bool = False, **ids: str
    ) -> None:
        """Let every message of the channel land in `mailbox` as Received.

        With `recover` also those that were missed and are still kept (`Qos.kept_s`): in any order,
        and some twice.
        """

    def recover(self, channel: str, **ids: str) -> None:
        """Ask once more for what was missed of a channel that was subscribed to with `recover`."""

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

    @property
    def connected(self) -> bool:
        """Whether the router is there now; an unplugged cable shows after the lease, 3 s."""

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
