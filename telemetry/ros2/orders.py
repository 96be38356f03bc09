"""The orders of a run as a gateway takes them: those alone that the run's keys have signed."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

from foretwin.contracts.bus import Bus, Mailbox, Received
from foretwin.contracts.guard import Refused
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.signing import OrderChannel, OrderCheck
from foretwin.contracts.towards_vehicle import Authority, OrderKeys, VehicleCommand

MOST_AT_ONCE = 64
"""So many are looked at between two looks at the dead man: a flood of forged ones keeps nobody."""

log = logging.getLogger("foretwin.telemetry.ros2")


class Orders:
    """Listens to the word of the orchestrator and to commands, and counts what does not count."""

    def __init__(
        self, bus: Bus, *, run_id: str, keys: OrderKeys, commands: bool, refusals: Refusals
    ) -> None:
        self._refusals = refusals
        self._inbox = Mailbox(MOST_AT_ONCE)
        public_keys: dict[OrderChannel, bytes] = {"authority": keys.authority}
        if commands:
            public_keys["vehicle_command"] = keys.vehicle_command
        self._checks: dict[str, OrderCheck] = {}
        for channel, public_key in public_keys.items():
            self._checks[channel] = OrderCheck(public_key, run_id=run_id, channel=channel)
            bus.subscribe(channel, self._inbox, run=run_id)

    @property
    def dropped(self) -> int:
        """How many came too fast to be looked at."""
        return self._inbox.dropped

    def take(self) -> Iterator[Authority | VehicleCommand]:
        """Yield what has come and counts."""
        for _ in range(MOST_AT_ONCE):
            item = self._inbox.take()
            if item is None:
                return
            if isinstance(item, Received) and (order := self._checked(item)) is not None:
                yield order

    def _checked(self, item: Received) -> Any:
        try:
            order = item.message()
            self._checks[item.channel].check(order, where=item.key)
        except Refused as refused:
            if text := self._refusals.take(refused):
                log.warning("%s", text)
            return None
        return order
