"""What a drive says of its vehicle while it goes on: parameters, the model's gap, and who departs.

Pure: its time is that of the samples, so that the same samples say the same.
"""

from __future__ import annotations

from typing import Any

import msgspec

from contracts.drive import VehicleInfo
from contracts.frames import LocalFrame
from contracts.gap import GapAlarm, GapSample, Verdict
from contracts.tuning import Identification, UseVehicle
from contracts.vehicle import VehicleParameters
from sim_worker.gap.monitor import GapMonitor
from sim_worker.identify.acceptance import in_force
from sim_worker.identify.tuner import Tuner

Finding = Identification | GapSample | GapAlarm | Verdict

SAMPLES = ("gnss", "imu", "speed", "heading", "steering", "control", "status")
"""Channels that say something of a vehicle's parameters, in the order of equal stamps."""


class VehicleWatch:
    """Identifies one vehicle and watches its gap; what is in force is told by `use`.

    `handle` takes samples under their channels, and estimated VehicleStates under "state".
    """

    def __init__(self, info: VehicleInfo, vehicle: VehicleParameters, *, frame: LocalFrame) -> None:
        self._in_force = vehicle
        self._tuner = Tuner(vehicle=vehicle, vehicle_id=info.vehicle_id, frame=frame)
        self._monitor = GapMonitor(info, vehicle, frame=frame)

    def handle(self, channel: str, message: Any) -> list[Finding]:
        """Take one message; return what follows from it."""
        found: list[Finding] = list(self._monitor.handle(channel, message))
        if channel == "state":
            return found
        told = self._tuner.handle(channel, message)
        if told is not None:
            # Taken here in any case: a later step is one from what was found, applied or not.
            self._tuner.take(told)
            found.append(self._against_what_counts(told))
        return found

    def _against_what_counts(self, told: Identification) -> Identification:
        estimates = tuple(
            msgspec.structs.replace(one, prior=in_force(self._in_force, one.name))
            for one in told.estimates
        )
        return msgspec.structs.replace(told, estimates=estimates)

    def use(self, message: UseVehicle) -> None:
        """Compare with these parameters from now on."""
        for change in message.changes:
            if change.origin in ("set", "rolled_back"):
                self._tuner.set(change.name, change.value, stamp_ns=change.stamp_ns)
        self._tuner.pinned = set(message.pinned)
        if message.vehicle != self._in_force:
            self._in_force = message.vehicle
            self._monitor.use_vehicle(message.vehicle)
