"""A vehicle beside the car that publishes on the bus."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from foretwin.contracts.bus import Received
from foretwin.contracts.drive import DriveEnd, VehicleInfo, VehicleState
from foretwin.contracts.roles import OtherVehicle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.other_vehicles.measured import OtherVehicleSource, OtherVehicleStates
from foretwin.orchestrator.other_vehicles.vehicle_clock import (
    THE_SAME,
    ClockApart,
    ClockReading,
    VehicleClock,
    between,
)
from foretwin.telemetry.estimator.estimator import estimator_of

APART_NS = 1_000_000_000
"""Stamps that differ by more are not by one clock."""
SILENT_S = 2.0
"""Who was not heard for so long is told of: gone it is long before."""


class LiveVehicle(OtherVehicleSource):
    """A vehicle that publishes on the bus, by whatever clock; its states are in the car's time.

    `ask_info` asks it what it is, once, as its first sample comes; until it answers, and where it
    does not, its reference point is taken as base_link. `own_clock` is how the car's clock stands
    to ours; None: the vehicle stamps by that very clock.
    """

    def __init__(
        self,
        vehicle_id: str,
        vehicle: VehicleParameters,
        *,
        ask_info: Callable[[str], None],
        tell: Callable[[Notice], None],
        own_clock: Callable[[], ClockReading | None] | None = None,
    ) -> None:
        super().__init__()
        self.clock = VehicleClock()
        """How its clock stands to ours."""
        self.between: ClockApart | None = THE_SAME if own_clock is None else None
        """How the car's stamps stand to its own."""
        self.found = self.between
        """What was found of it last, also after it has left."""
        self._own_clock = own_clock
        self._id, self._vehicle = vehicle_id, vehicle
        self._ask_info, self._tell = ask_info, tell
        self._measured: OtherVehicleStates | None = None
        self._clock_reported = False
        self._heard_s: float | None = None
        self._silent = False
        self.over = False
        """Whether its last word was heard."""

    @property
    def trouble(self) -> str:
        """Why its states do not count yet, in words; empty where they do."""
        if self.between is not None:
            return ""
        if self._measured is None:
            return f"nothing was heard of {self._id}"
        return f"nobody can tell how the clock of {self._id} stands to the car's"

    def begin_anew(self) -> None:
        """Forget what was heard: somebody else speaks for it from now on, or nobody."""
        own_clock = self._own_clock
        self.clock, self.between = VehicleClock(), THE_SAME if own_clock is None else None
        self._measured, self._heard_s = None, None
        self._clock_reported = self._silent = self.over = False
        self._heard.clear()

    def look(self, now_s: float) -> None:
        """Tell once where nothing came until `now_s`, by our monotonic clock, and until then all
        was taken."""
        silent = self._heard_s is not None and now_s - self._heard_s > SILENT_S
        if silent and not (self._silent or self.over):
            self._silent = True
            self._tell(Notice("warning", f"{self._id} is silent: gone until it is heard again"))

    def take(self, item: Received) -> None:
        """Take a sample from the bus; raises Refused where the guard does not let it in."""
        message = item.message()
        self._heard_s = item.received_mono_ns / 1e9
        if isinstance(message, DriveEnd):
            self.over = True
            return
        if self._silent:
            self._silent = False
            self._tell(Notice("info", f"{self._id} is heard again"))
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
        """Return what has come since the last time, by the car's clock once that is known."""
        if self._own_clock is not None:
            return self._in_own_time(self._own_clock())
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

    def _in_own_time(self, own: ClockReading | None) -> list[OtherVehicle]:
        one_way_ns = None if self._measured is None else self._measured.clock_offset_ns
        theirs = self.clock.reading(one_way_ns)
        if own is None or theirs is None:
            self._heard.clear()  # when it was nobody can say
            return []
        self.between = self.found = found = between(own, theirs)
        if self._heard and not self._clock_reported:
            self._clock_reported = True
            self._tell(Notice("info", f"{self._id}: {found.text}"))
        heard = [_later(one, found) for one in self._heard]
        self._heard.clear()
        return heard


def _later(heard: OtherVehicle, by: ClockApart) -> OtherVehicle:
    """Return what was heard of a vehicle, with stamps of the car's clock."""
    return OtherVehicle(
        state=msgspec.structs.replace(heard.state, stamp_ns=heard.state.stamp_ns + by.later_ns),
        commands=tuple(
            msgspec.structs.replace(one, stamp_ns=one.stamp_ns + by.later_ns)
            for one in heard.commands
        ),
        clock_std_s=by.std_s,
    )
