"""Who of a drive is there when, by the tokens on its bus: how soon somebody who died is back."""

from __future__ import annotations

from typing import NamedTuple, Self

from foretwin.contracts.bus import Alive, BusUnreachable, Mailbox, ZenohBus
from foretwin.contracts.keys import alive_key, process_of_alive_key
from foretwin.contracts.setup import BusSetup


class Seen(NamedTuple):
    """Somebody came or went, by the monotonic clock."""

    ns: int
    name: str
    up: bool


class Watcher:
    """Hears the tokens of one run; a context. Without a bus it sees nobody."""

    def __init__(self, setup: BusSetup, run_id: str) -> None:
        self._seen: list[Seen] = []
        self._mailbox = Mailbox(100_000)
        self._bus: ZenohBus | None = None
        try:
            self._bus = ZenohBus(setup)
        except BusUnreachable:
            return
        self._bus.watch_alive(alive_key(run=run_id, process="*"), self._mailbox)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *what: object) -> None:
        if self._bus is not None:
            self._bus.close()

    @property
    def seen(self) -> list[Seen]:
        """All who came and went so far."""
        while (item := self._mailbox.take()) is not None:
            if isinstance(item, Alive):
                name = process_of_alive_key(item.key)
                self._seen.append(Seen(item.received_mono_ns, name, item.up))
        return self._seen


def back_after_s(seen: list[Seen], name: str, died_ns: int) -> float | None:
    """Return after how long somebody who died then was there again, None where he was not.

    A dead router takes all tokens along: it is there again with the first of them.
    """
    after = sorted(one for one in seen if one.ns > died_ns and name in (one.name, "router"))
    gone_ns = next((one.ns for one in after if not one.up), None)
    back = [one.ns for one in after if one.up and gone_ns is not None and one.ns > gone_ns]
    return (back[0] - died_ns) * 1e-9 if back else None
