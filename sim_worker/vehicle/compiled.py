"""The inner part of a control tick, compiled: tyres, steering, states."""

from __future__ import annotations

import math

from foretwin.contracts.arrays import Array
from foretwin.geometry.compiled import IN, IN_ROWS, OUT, OUT_ROWS, REAL, kernel, types

_CARS, _AXLES, _CONSTANTS = [IN] * 4, [IN_ROWS] * 3, types.UniTuple(REAL, 5)


@kernel(types.void, *_CARS, *_AXLES, _CONSTANTS, IN, *[OUT_ROWS] * 4, OUT, OUT)
def forces(
    accel: Array,
    speed: Array,
    grip_square: Array,
    least_square: Array,
    transfer: Array,
    axles_kg: Array,
    stiffness: Array,
    constants: tuple[float, ...],
    gear: Array,
    damping: Array,
    low: Array,
    high: Array,
    drive_n: Array,
    along_low: Array,
    along_high: Array,
) -> None:
    """Fill what `Actuation.apply` writes, from accelerations that are carried out (S,)."""
    mass, rolling, drag, least_kg, least_mps = constants
    for car in range(len(accel)):
        a, u = accel[car], speed[car]
        across = math.sqrt(max(grip_square[car] - a * a, least_square[car]))
        slow = max(abs(u), least_mps)
        for axle in range(2):
            load = max(transfer[axle, car] * (a * gear[car]) + axles_kg[axle, car], least_kg)
            damping[axle, car] = stiffness[axle, car] * load / slow
            high[axle, car] = load * across
            low[axle, car] = -load * across
        force = mass * a
        drive = max(force, 0.0)
        brake = drive - force + rolling
        drive = drive * gear[car] - abs(u) * u * drag
        for step in range(drive_n.shape[0]):
            drive_n[step, car] = drive
        along_low[car] = drive - brake
        along_high[car] = drive + brake


@kernel(types.void, IN, OUT, REAL, OUT_ROWS)
def ramp(angle: Array, command: Array, step_rad: float, steer: Array) -> None:
    """Fill `steer` (steps, S) from the last `command` (S,) towards `angle`, and keep the end."""
    for car in range(len(command)):
        begin = command[car]
        change = angle[car] - begin
        for step in range(steer.shape[0]):
            reach = step_rad * (step + 1.0)
            steer[step, car] = begin + max(min(change, reach), -reach)
        command[car] = steer[-1, car]


@kernel(types.void, IN_ROWS, REAL, REAL, OUT_ROWS, OUT_ROWS)
def read_base(joints: Array, rear_m: float, tick_s: float, states: Array, heading: Array) -> None:
    """Fill base_link `states` (8, S), and `heading` (2, S), from joints (8, S)."""
    for car in range(states.shape[1]):
        cos, sin = math.cos(joints[2, car]), math.sin(joints[2, car])
        vx, vy, rate = joints[4, car], joints[5, car], joints[6, car]
        before = states[3, car]
        states[0, car] = joints[0, car] - rear_m * cos
        states[1, car] = joints[1, car] - rear_m * sin
        states[2, car] = joints[2, car]
        states[3, car] = cos * vx + sin * vy
        states[4, car] = cos * vy - sin * vx - rear_m * rate
        states[5, car] = rate
        states[6, car] = joints[3, car]
        states[7, car] = (states[3, car] - before) / tick_s
        heading[0, car], heading[1, car] = cos, sin


@kernel(types.boolean, IN_ROWS, IN)
def all_sane(states: Array, most: Array) -> bool:
    """Whether no column of `states` (8, S) is beyond its bound (8,)."""
    for column in range(states.shape[0]):
        for car in range(states.shape[1]):
            if not abs(states[column, car]) < most[column]:
                return False
    return True
