"""Who may give orders towards a vehicle in a test: both keys of a run, and what they sign."""

from __future__ import annotations

from foretwin.contracts.bus import Bus
from foretwin.contracts.signing import OrderSigner
from foretwin.contracts.towards_vehicle import Authority, OrderKeys, VehicleCommand


class OrderSide:
    """The orchestrator and a commander of one run, with the same keys in every process."""

    def __init__(self, run_id: str) -> None:
        self._run_id = run_id
        self.authority = OrderSigner(b"a" * 32, run_id=run_id, channel="authority")
        self.command = OrderSigner(b"c" * 32, run_id=run_id, channel="vehicle_command")

    @property
    def keys(self) -> OrderKeys:
        return OrderKeys(
            authority=self.authority.public_key, vehicle_command=self.command.public_key
        )

    def say(self, bus: Bus, order: Authority | VehicleCommand) -> None:
        """Sign and publish."""
        if isinstance(order, Authority):
            bus.publish("authority", self.authority.signed(order), run=self._run_id)
        else:
            bus.publish("vehicle_command", self.command.signed(order), run=self._run_id)
