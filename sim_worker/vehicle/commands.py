"""Commands for the twin: the car's own as they apply at the tyres, or estimated from its motion."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import ControlCommand
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.steering import column_of
from foretwin.sim_worker.driver_model import HOLD_MPS2
from foretwin.sim_worker.vehicle.resistance import resistance_mps2

STEP_BACK_NS = 1_000_000_000
"""A stamp that lies this far behind the last one is of a clock that has stepped back."""
HELD_NS = 500_000_000
"""A command older than this holds no longer: a human took over, or those after it were lost."""
_STANDS_MPS = 0.05


class TwinCommand(NamedTuple):
    """The command of the twin from `stamp_ns` on."""

    stamp_ns: int
    accel_mps2: float
    tire_angle_rad: float


class CommandMemory:
    """The car's recorded commands, in time; each holds until the next, or until it is lost.

    What a stack commands while a human drives moves nothing, and never did.
    """

    def __init__(self, vehicle: VehicleParameters, *, keep_s: float) -> None:
        self._vehicle = vehicle
        self._keep_ns = round(keep_s * 1e9)
        self._commands: deque[TwinCommand] = deque()
        self._human_ns: int | None = None
        self.estimated = False
        """Whether any command received was itself an estimate."""

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Turn steering wheels into tyres with these parameters in commands yet to come."""
        self._vehicle = vehicle

    def add(self, command: ControlCommand) -> None:
        """Take a command; older or equal stamps than the latest are ignored.

        One from before a clock's step back makes all others forgotten.
        """
        latest = self._commands[-1] if self._commands else None
        if latest is not None and command.stamp_ns < latest.stamp_ns - STEP_BACK_NS:
            self._commands.clear()
            self._human_ns = None
            latest = latest._replace(stamp_ns=command.stamp_ns - 1)
        if latest is not None and command.stamp_ns <= latest.stamp_ns:
            return
        self.estimated = self.estimated or command.estimated
        column = column_of(self._vehicle)
        if command.tire_angle_rad is not None:
            angle = command.tire_angle_rad + column.offset_rad
        elif command.steering_wheel_rad is not None:
            angle = column.tire_rad(command.steering_wheel_rad)
        else:
            before = 0.0 if latest is None else latest.tire_angle_rad - column.offset_rad
            angle = before + column.offset_rad
        if np.isfinite(angle) and np.isfinite(command.accel_mps2):
            self._commands.append(TwinCommand(command.stamp_ns, command.accel_mps2, angle))

    def human_drives(self, stamp_ns: int) -> None:
        """Let no command up to `stamp_ns` have moved the car, those yet to come included."""
        self._human_ns = stamp_ns

    def _moved(self, stamp_ns: int) -> bool:
        return self._human_ns is None or stamp_ns > self._human_ns

    def forget_before(self, stamp_ns: int) -> None:
        """Drop what lies further back than is kept, the one that still holds excepted."""
        oldest = stamp_ns - self._keep_ns
        while len(self._commands) > 1 and self._commands[1].stamp_ns <= oldest:
            self._commands.popleft()

    def at(self, stamp_ns: int) -> TwinCommand | None:
        """Return the command that holds at `stamp_ns`; None before the first and once lost."""
        for command in reversed(self._commands):
            if command.stamp_ns <= stamp_ns:
                held = stamp_ns - command.stamp_ns <= HELD_NS and self._moved(command.stamp_ns)
                return command if held else None
        return None

    def angles_before(self, stamp_ns: int, *, count: int, step_ns: int) -> Array | None:
        """Return (count,) tyre angles commanded up to `stamp_ns`, latest last; None if unknown."""
        if self.at(stamp_ns) is None:
            return None
        moved = [command for command in self._commands if self._moved(command.stamp_ns)]
        stamps = np.array([command.stamp_ns for command in moved])
        angles = np.array([command.tire_angle_rad for command in moved])
        at = stamp_ns - step_ns * np.arange(count - 1, -1, -1)
        return np.asarray(angles[np.maximum(np.searchsorted(stamps, at, side="right") - 1, 0)])


def estimated_command(
    vehicle: VehicleParameters,
    before: Array,
    after: Array,
    *,
    stamp_ns: int,
    duration_s: float,
    climb_mps2: float = 0.0,
) -> TwinCommand:
    """Return the command that turns one measured state (8,) into the next `duration_s` later.

    Inverts the twin's own gains and resistances, a slope's `climb_mps2` included, with the mean
    tyre angle of both ends and no delay: the twin then repeats the motion, and its gap tests the
    plumbing alone. In a curve, F / m = du/dt - v r + (F_front / m) sin δ at the centre of gravity
    (Rajamani 2012, ch. 2).
    """
    speed, slip, rate, angle = 0.5 * (before[3:7] + after[3:7])
    if abs(before[3]) < _STANDS_MPS and abs(after[3]) < _STANDS_MPS:
        return TwinCommand(stamp_ns, HOLD_MPS2, float(after[6]))
    rear = vehicle.cog_from_rear_axle_m.value
    front_force = rear / vehicle.wheelbase_m.value * speed * rate / np.cos(angle)
    wanted = float(after[3] - before[3]) / duration_s
    wanted += float(front_force * np.sin(angle) - (slip + rear * rate) * rate)
    force = wanted * vehicle.wheel_inertia_mass_factor.value
    force += float(resistance_mps2(vehicle, np.array([speed]))[0]) + climb_mps2
    gain = vehicle.drive_gain.value if force > 0.0 else vehicle.brake_gain.value
    return TwinCommand(stamp_ns, force / gain, float(angle))
