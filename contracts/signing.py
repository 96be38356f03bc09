"""Orders towards a vehicle are signed with a key of their run and numbered: who takes them trusts
the holder of the key, not the bus.

The signature (Ed25519, RFC 8032) covers the run's id, the channel, the number and the content, so
that no order counts in another run, on another channel, or twice. A key pair is made for each run
and channel; its private half never travels over the bus.
"""

from __future__ import annotations

import itertools
import os
import time
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

import msgspec

from foretwin.contracts.codec import content_bytes
from foretwin.contracts.guard import Refused
from foretwin.contracts.towards_vehicle import Order

OrderChannel = Literal["authority", "vehicle_command"]
COMMAND_KEY = "command.key"
"""In a run's folder, while anything may go towards the vehicle: what commands are signed with."""
_DOMAIN = "foretwin order 1"
"""Of these signatures alone: what another protocol signs with the same key is no order."""
_KEY_BYTES, _SIGNATURE_BYTES = 32, 64
NOT_SIGNED = "not signed with this run's key"
NOT_NEW = "a number that is not new: replayed or out of order"

_Order = TypeVar("_Order", bound=Order)


class OrderSigner:
    """Signs and numbers the orders of one channel of one run.

    Numbers begin at the host's monotonic clock: who is started again with the same key goes on
    above what it has said before.
    """

    def __init__(self, private_key: bytes, *, run_id: str, channel: OrderChannel) -> None:
        """Take a key's 32 bytes; raises ValueError for any other number of them."""
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

        self._key = Ed25519PrivateKey.from_private_bytes(private_key)
        self._run_id, self._channel = run_id, channel
        self._numbers = itertools.count(time.monotonic_ns())

    @classmethod
    def with_new_key(cls, *, run_id: str, channel: OrderChannel) -> Self:
        """Return a signer with a key that nobody else has."""
        return cls(os.urandom(_KEY_BYTES), run_id=run_id, channel=channel)

    @classmethod
    def of_commands(cls, run_folder: Path) -> Self:
        """Return who signs the commands of a running drive, by the key in the run's folder.

        Raises OSError where there is none (nothing may go towards the vehicle, the drive is over,
        or it is another user's), ValueError for a file that is none.
        """
        private_key = (run_folder / COMMAND_KEY).read_bytes()
        return cls(private_key, run_id=run_folder.resolve().name, channel="vehicle_command")

    @property
    def public_key(self) -> bytes:
        """What the signatures are checked with."""
        return self._key.public_key().public_bytes_raw()

    def keep(self, file: Path) -> None:
        """Write the private key to a new file that its owner alone may read."""
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as opened:
            opened.write(self._key.private_bytes_raw())

    def signed(self, order: _Order) -> _Order:
        """Return the order with the next number and its signature."""
        numbered = msgspec.structs.replace(order, number=next(self._numbers), signature=b"")
        signature = self._key.sign(_text(numbered, self._run_id, self._channel))
        return msgspec.structs.replace(numbered, signature=signature)


class OrderCheck:
    """Lets through the orders of one channel that the run's key signed, each once and in order."""

    def __init__(self, public_key: bytes, *, run_id: str, channel: OrderChannel) -> None:
        """Take a public key's 32 bytes; raises ValueError for any other number of them."""
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

        self._key: Any = Ed25519PublicKey.from_public_bytes(public_key)
        self._run_id, self._channel = run_id, channel
        self._last = -1

    def check(self, order: Order, *, where: str) -> None:
        """Raise Refused for an order that does not count; `where` is the key by which it came."""
        from cryptography.exceptions import InvalidSignature

        # First what costs nothing: saying again what was heard is the cheapest flood.
        if len(order.signature) != _SIGNATURE_BYTES:
            raise Refused(where, NOT_SIGNED)
        if order.number <= self._last:
            raise Refused(where, NOT_NEW)
        try:
            unsigned = msgspec.structs.replace(order, signature=b"")
            self._key.verify(order.signature, _text(unsigned, self._run_id, self._channel))
        except InvalidSignature:
            raise Refused(where, NOT_SIGNED) from None
        self._last = order.number


def _text(order: Order, run_id: str, channel: OrderChannel) -> bytes:
    """Return what is signed: parts that hold no zero byte, then the content."""
    return b"\0".join((_DOMAIN.encode(), run_id.encode(), channel.encode(), content_bytes(order)))
