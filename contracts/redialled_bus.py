"""The bus over a link between machines, which is there again soon after the link is.

Zenoh dials again by itself, but waits in each attempt as TCP does, which repeats a call that nobody
took after a second, then ever more rarely. Here somebody knocks at the router's port several times
a second for as long as it is gone. Once a knock gets through, a new session takes the place of
the old one, with all that was declared.
"""

from __future__ import annotations

import contextlib
import logging
import select
import socket
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

import msgspec

from foretwin.contracts.bus import Bus, BusUnreachable, ZenohBus
from foretwin.contracts.mailbox import Mailbox
from foretwin.contracts.ports import ListenPlace, tcp_place
from foretwin.contracts.process_setup import BusSetup

KNOCK_EVERY_S = 0.2
_MOST_KNOCKS = 5
"""So many wait at once: on a slow link the answer to one comes after the next has begun."""
_LOOK_EVERY_S = 0.1

log = logging.getLogger(__name__)


class Session(Bus, Protocol):
    """One of several sessions that are as one bus."""

    def go_on_as(self, other: object) -> None:
        """Take the place of another session that has lost its router; None is before the first.

        Who hears it hears the same sender, with its numbers, and can ask for what that had kept.
        """


class Door(Protocol):
    """Where one knocks."""

    def opens(self) -> bool:
        """Knock once more, and wait a moment for the answer to any knock."""

    def close(self) -> None:
        """Knock no more."""


class TcpDoor:
    """A port of another machine; its name is looked up once, while it can be."""

    def __init__(self, place: ListenPlace) -> None:
        found = socket.getaddrinfo(*place, type=socket.SOCK_STREAM)
        self._family, self._address = found[0][0], found[0][4]
        self._knocks: deque[socket.socket] = deque()

    def opens(self) -> bool:
        """See Door."""
        while len(self._knocks) >= _MOST_KNOCKS:
            self._knocks.popleft().close()
        knock = socket.socket(self._family)
        knock.setblocking(False)
        self._knocks.append(knock)
        with contextlib.suppress(OSError):  # told below: that it goes on, or has failed
            knock.connect(self._address)
        _, answered, _ = select.select([], self._knocks, [], KNOCK_EVERY_S)
        if any(one.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR) == 0 for one in answered):
            self.close()
            return True
        for one in answered:
            self._knocks.remove(one)
            one.close()
        return False

    def close(self) -> None:
        """See Door."""
        while self._knocks:
            self._knocks.pop().close()


class RedialledBus:
    """One Zenoh session after the other, as one bus.

    Raises BusUnreachable where there is no router at first, OSError where its name is not known.
    """

    def __init__(
        self,
        setup: BusSetup,
        *,
        dial: Callable[[BusSetup], Session] = ZenohBus,
        door: Callable[[ListenPlace], Door] = TcpDoor,
    ) -> None:
        self._setup, self._dial = setup, dial
        self._bus = dial(setup)
        self._declared: list[Callable[[Bus], None]] = []
        """In the order in which it was: who is alive can answer."""
        self._lock = threading.Lock()
        self._over = threading.Event()
        place = tcp_place(setup.endpoint)
        self._door = None if place is None else door(place)
        self._thread = threading.Thread(target=self._stand_by, name="redial", daemon=True)
        if self._door is not None:  # else no session takes the place of this one
            self._bus.go_on_as(None)
            self._thread.start()

    def publish(self, channel: str, message: msgspec.Struct, **ids: str) -> None:
        """Send one message; see Bus."""
        with self._lock:
            self._bus.publish(channel, message, **ids)

    def subscribe(
        self, channel: str, mailbox: Mailbox, *, recover: bool = False, **ids: str
    ) -> None:
        """Receive into `mailbox`; see Bus."""
        self._declare(lambda bus: bus.subscribe(channel, mailbox, recover=recover, **ids))

    def recover(self, channel: str, **ids: str) -> None:
        """Ask again for what is kept of a channel; see Bus."""
        with self._lock:
            self._bus.recover(channel, **ids)

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
        """Ask; see Bus. A question whose session ends finds no answer."""
        with self._lock:
            self._bus.request(channel, message, mailbox, tag=tag, timeout_s=timeout_s, **ids)

    def serve(self, channel: str, mailbox: Mailbox, **ids: str) -> None:
        """Answer questions; see Bus."""
        self._declare(lambda bus: bus.serve(channel, mailbox, **ids))

    def declare_alive(self, alive_key: str) -> None:
        """Hold a liveliness token, of a life for each session; see Bus."""
        self._declare(lambda bus: bus.declare_alive(alive_key))

    def watch_alive(self, alive_key: str, mailbox: Mailbox) -> None:
        """Watch liveliness tokens; see Bus."""
        self._declare(lambda bus: bus.watch_alive(alive_key, mailbox))

    @property
    def connected(self) -> bool:
        """Whether the router is there now; see Bus."""
        with self._lock:
            return self._bus.connected

    def close(self) -> None:
        """Undeclare everything; idempotent."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        with self._lock:
            self._bus.close()

    def redial(self) -> None:
        """Put a new session in the place of one that has lost its router, and finds it no more."""
        try:
            new = self._dial(self._setup)
        except BusUnreachable as error:
            log.info("%s", error)
            return
        with self._lock:
            old, kept = self._bus, self._bus.connected
            if not kept:
                new.go_on_as(old)
                self._bus = new
                for declare in self._declared:
                    declare(new)
        (new if kept else old).close()

    def _declare(self, declare: Callable[[Bus], None]) -> None:
        with self._lock:
            declare(self._bus)
            self._declared.append(declare)

    def _stand_by(self) -> None:
        assert self._door is not None
        while not self._over.wait(_LOOK_EVERY_S):
            if self.connected:
                self._door.close()
            elif self._door.opens():
                self.redial()
        self._door.close()
