"""A vehicle beside the car that publishes on the bus."""

from __future__ import annotations

from collections.abc import Callable

from foretwin.contracts.bus import Received
from foretwin.contracts.drive import VehicleInfo, VehicleState
from foretwin.contracts.roles import OtherVehicle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.other_vehicles.measured import OtherVehicleSource, OtherVehicleStates
from foretwin.telemetry.estimator.estimator import estimator_of

APART_NS = 1_000_000_000
"""Stamps that differ by more are not by one clock."""


class LiveVehicle(OtherVehicleSource):
    """A vehicle that publishes on the bus by the car's own clock.

    `ask_info` asks it what it is, once, as its first sample comes; until it answers, and where it
    does not, its reference point is taken as base_link.
    """

    def __init__(
        self,
        vehicle_id: str,
        vehicle: VehicleParameters,
        *,
        ask_info: Callable[[str], None],
        tell: Callable[[Notice], None],
    ) -> None:
        super().__init__()
        self._id, self._vehicle = vehicle_id, vehicle
        self._ask_info, self._tell = ask_info, tell
        self._measured: OtherVehicleStates | None = None
        self._clock_reported = False

    def take(self, item: Received) -> None:
        """Take a sample from the bus; raises Refused where the guard does not let it in."""
        message = item.message()
        if self._measured is None:
            info = VehicleInfo(
                vehicle_id=self._id, time_base="utc", start_stamp_ns=message.stamp_ns
            )
            self._measured = OtherVehicleStates(self._id, estimator_of(info, self._vehicle))
            self._tell(Notice("info", f"{self._id} is heard"))
            self._ask_info(self._id)
        heard = self._measured.take(item.channel, message, received_ns=item.received_mono_ns)
        if heard is not None:
            self._heard.append(heard)

    def take_info(self, info: VehicleInfo | None) -> None:
        """Take what the vehicle says of itself, None where it does not answer."""
        if info is None or info.body_from_antenna_m is None:
            text = (
                f"{self._id} does not say where on it its positions are of: taken as the middle of "
                "its rear axle; antenna_m in its mapping says it"
            )
            self._tell(Notice("warning", text))
        elif self._measured is not None:
            self._measured.begin_anew(estimator_of(info, self._vehicle))

    def states_until(self, own: VehicleState) -> list[OtherVehicle]:
        """Return what has come since the last time."""
        heard = super().states_until(own)
        if heard and not self._clock_reported:
            ahead_ns = heard[-1].state.stamp_ns - own.stamp_ns
            if abs(ahead_ns) > APART_NS:
                self._clock_reported = True
                text = (
                    f"{self._id} stamps {abs(ahead_ns) / 1e9:.1f} s "
                    f"{'ahead of' if ahead_ns > 0 else 'behind'} the car: it must stamp by the "
                    "car's clock"
                )
                self._tell(Notice("warning", text))
        return heard
