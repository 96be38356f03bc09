"""What a drive says of its vehicle while it goes on: parameters, the model's gap, departures.

Pure: its time is that of the samples, so that the same samples say the same.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from foretwin.contracts.drive import VehicleInfo
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.gap import GapAlarm, GapSample, Verdict
from foretwin.contracts.tuning import Identification, UseVehicle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.analysis.gap.monitor import GapMonitor
from foretwin.sim_worker.analysis.identify.acceptance import with_priors
from foretwin.sim_worker.analysis.identify.tuner import Tuner
from foretwin.sim_worker.vehicle.commands import STEP_BACK_NS

Finding = Identification | GapSample | GapAlarm | Verdict

SAMPLES = ("gnss", "imu", "speed", "heading", "steering", "control", "status")
"""Channels that say something of a vehicle's parameters, in the order of equal stamps."""


_AHEAD_NS = 10_000_000_000


class VehicleWatch:
    """Identifies one vehicle and watches its gap; what is in force is result by `use`.

    `handle` takes samples under their channels, and estimated VehicleStates under "state". Where
    those go back in time, the vehicle's clock has been set: all is watched anew. Samples far ahead
    of the states are passed over, since one wrong stamp would make all later ones late.
    """

    def __init__(
        self,
        info: VehicleInfo,
        vehicle: VehicleParameters,
        *,
        frame: LocalFrame,
        roads: Slopes | None = None,
    ) -> None:
        """`roads` in `frame` are those of the map, where it is known not to be flat."""
        self._roads = roads
        self._in_force = vehicle
        self._info, self._frame = info, frame
        self._state_ns: int | None = None
        self._begin(pinned=frozenset())

    def _begin(self, *, pinned: Collection[str]) -> None:
        vehicle_id, frame = self._info.vehicle_id, self._frame
        self._tuner = Tuner(
            vehicle=self._in_force, vehicle_id=vehicle_id, frame=frame, roads=self._roads
        )
        self._tuner.pinned = set(pinned)
        self._monitor = GapMonitor(self._info, self._in_force, frame=frame, roads=self._roads)

    def handle(self, channel: str, message: Any) -> list[Finding]:
        """Take one message; return what follows from it."""
        before_ns, stamp_ns = self._state_ns, message.stamp_ns
        if channel == "state":
            if before_ns is not None and stamp_ns < before_ns - STEP_BACK_NS:
                self._begin(pinned=self._tuner.pinned)
            self._state_ns = stamp_ns
        elif before_ns is not None and stamp_ns > before_ns + _AHEAD_NS:
            return []
        found: list[Finding] = list(self._monitor.handle(channel, message))
        if channel == "state":
            return found
        result = self._tuner.handle(channel, message)
        if result is not None:
            # Taken here in any case: a later step is one from what was found, applied or not.
            self._tuner.take(result)
            found.append(with_priors(result, self._in_force))
        return found

    def use(self, message: UseVehicle) -> None:
        """Compare with these parameters from now on."""
        for change in message.changes:
            if change.origin in ("set", "rolled_back"):
                self._tuner.set(change.name, change.value, stamp_ns=change.stamp_ns)
        self._tuner.pinned = set(message.pinned)
        if message.vehicle != self._in_force:
            self._in_force = message.vehicle
            self._monitor.use_vehicle(message.vehicle)
