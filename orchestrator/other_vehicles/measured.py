"""Samples of a vehicle beside the car to states of it."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import msgspec

from foretwin.contracts.drive import ControlCommand, ControlMode, VehicleState, VehicleStatus
from foretwin.contracts.roles import OtherVehicle

if TYPE_CHECKING:  # its arithmetic is compiled, and who makes the estimator loads the compiler
    from foretwin.telemetry.estimator.estimator import StateEstimator

MOST_HEARD = 1000
"""States that wait for one of the car, and commands for one of their vehicle: the newest."""
PERIOD_NS = 18_000_000
"""Between two states of a vehicle that are passed on: 50 Hz at most."""


class OtherVehicleSource:
    """Where a vehicle's states come from: here from what is heard as it comes."""

    def __init__(self) -> None:
        self._heard: deque[OtherVehicle] = deque(maxlen=MOST_HEARD)

    def states_until(self, own: VehicleState) -> list[OtherVehicle]:
        """Return what is new of it as the car comes to its own new state, by the car's clock."""
        heard = list(self._heard)
        self._heard.clear()
        return heard

    def close(self) -> None:
        """Let go of files and threads, where there are any; idempotent."""


class OtherVehicleStates:
    """Samples of one vehicle to states, as far apart as is worth passing on."""

    def __init__(self, vehicle_id: str, estimator: StateEstimator) -> None:
        self._id, self._estimator = vehicle_id, estimator
        self._commands: deque[ControlCommand] = deque(maxlen=MOST_HEARD)
        self._last_ns: int | None = None
        self._mode: ControlMode = "unknown"

    @property
    def clock_offset_ns(self) -> int | None:
        """Receipt less stamp of the least delayed sample; None before there is one."""
        return self._estimator.clock_offset_ns

    def begin_anew(self, estimator: StateEstimator) -> None:
        """Forget the motion so far, since more is known of the vehicle now."""
        self._estimator = estimator

    def take(
        self,
        channel: str,
        message: msgspec.Struct,
        *,
        later_ns: int = 0,
        received_ns: int | None = None,
    ) -> OtherVehicle | None:
        """Take one sample; `later_ns` is added to its stamp once the state is estimated.

        `received_ns` is its receipt by the monotonic clock; None where samples are in order.
        """
        if isinstance(message, ControlCommand):
            stamp_ns = message.stamp_ns + later_ns
            self._commands.append(msgspec.structs.replace(message, stamp_ns=stamp_ns))
        elif isinstance(message, VehicleStatus):
            self._mode = message.control_mode
        state = self._estimator.handle(channel, message, received_ns=received_ns)
        if state is None or not state.yaw_valid:
            return None
        stamp_ns = state.stamp_ns + later_ns
        if self._last_ns is not None and stamp_ns - self._last_ns < PERIOD_NS:
            return None
        commands = tuple(self._commands)
        self._commands.clear()
        self._last_ns = stamp_ns
        moved = msgspec.structs.replace(
            state, stamp_ns=stamp_ns, vehicle_id=self._id, control_mode=self._mode
        )
        return OtherVehicle(state=moved, commands=commands)
