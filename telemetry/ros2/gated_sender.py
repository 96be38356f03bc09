"""The only way out to the vehicle's ROS 2: what goes towards the vehicle passes the gate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

from foretwin.contracts.foreign_bus import ForeignBus
from foretwin.telemetry.ros2.cadence import Cadence
from foretwin.telemetry.ros2.rows import OutRow
from foretwin.telemetry.ros2.safety import VehicleGate
from foretwin.telemetry.ros2.sender import RosSender


class GatedSender:
    """Sends rows, each at its rate; `held` counts by topic what was not sent, and why."""

    def __init__(
        self,
        sender: RosSender,
        gate: VehicleGate,
        *,
        foreign: ForeignBus,
        max_rate_hz: float,
        mono_ns: Callable[[], int],
    ) -> None:
        """`max_rate_hz` is that of each topic towards the vehicle."""
        self._sender, self._gate, self._foreign = sender, gate, foreign
        self._least_ns, self._mono_ns = int(1e9 / max_rate_hz), mono_ns
        self._due = Cadence(mono_ns).due
        self.held: Counter[str] = Counter()

    def send(
        self,
        rows: Iterable[OutRow],
        payload: Callable[[OutRow], bytes | None],
        *,
        every_ns: int = 0,
    ) -> None:
        """Send on rows; towards the vehicle only through the gate, at its rate."""
        for row in rows:
            least_ns = every_ns
            if row.towards_vehicle:
                least_ns = max(every_ns, self._least_ns)
                now_ns, link_up = self._mono_ns(), self._foreign.connected
                if self._gate.look(now_ns=now_ns, link_up=link_up) != "open":
                    self.held[row.topic] += 1
                    continue
            if not self._due(row.topic, least_ns):
                continue
            try:
                self.put(row, payload(row))
            except Exception as error:  # no message may end the gateway
                # A stamp that no ROS time holds, a number that 32 bits do not.
                self.held[f"{row.topic}: {type(error).__name__}"] += 1

    def put(self, row: OutRow, payload: bytes | None) -> None:
        """Send one message, if any; refuses once more what must not leave."""
        if payload is None:
            return
        if row.towards_vehicle and self._gate.state != "open":
            self.held[row.topic] += 1
            return
        self._sender.put(row, payload)
