"""The inner part of a control tick, compiled by numba: the same formulas, car by car.

A numpy call costs as much for 64 cars as for one: at 50 ticks a second, some 150 calls took
longer than the physics. Here is nothing but arithmetic on arrays that others own; what it means
is told where it is called. All is compiled at import, for one signature and no other: nobody
waits for a compiler in the middle of a drive.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numpy as np

from foretwin.contracts.arrays import Array

_Function = TypeVar("_Function", bound=Callable[..., Any])

types: Any = numba.types  # whose annotations are incomplete
REAL, WHOLE = types.float64, types.intp
_OUT, _OUT_ROWS = REAL[:], REAL[:, :]


def given(dimensions: int, layout: str = "A") -> Any:
    """Return the type of what is only read: whatever numpy hands over, slices too, and what a
    message holds, read-only and anywhere; with layout "C" as `np.ascontiguousarray` leaves it."""
    return types.Array(REAL, dimensions, layout, readonly=True, aligned=False)


_IN, _IN_ROWS = given(1), given(2)
_LINE, _TABLE = given(1, "C"), given(2, "C")


def kernel(returns: Any, *arguments: Any) -> Callable[[_Function], _Function]:
    """Compile for these types, or take it from the cache: `__pycache__` beside this file, else the
    user's cache folder, or `NUMBA_CACHE_DIR`; where none can be written, for this process alone."""

    def compiled(function: _Function) -> _Function:
        # Without fast-math: the same order of operations gives the same bits on every machine.
        def compile_it(cache: bool) -> _Function:
            jit = numba.njit(returns(*arguments), cache=cache, error_model="numpy")
            found: _Function = jit(function)
            return found

        try:
            return compile_it(cache=True)
        except (RuntimeError, OSError):
            return compile_it(cache=False)

    return compiled


@kernel(types.void, _IN_ROWS, _IN, _TABLE, _TABLE, REAL, WHOLE, _OUT_ROWS)
def locate(
    xy: Array, near_arc_m: Array, nodes: Array, segments: Array,
    first_arc_m: float, either: int, found: Array,
) -> None:  # fmt: skip
    """Fill `found` (2, S): arc length and offset of positions (2, S), as `FrenetPath.locate`."""
    last = nodes.shape[1] - 1
    for car in range(xy.shape[1]):
        x, y = xy[0, car], xy[1, car]
        start = min(max(near_arc_m[car] - (first_arc_m + either), 0.0), float(last - 2 * either))
        if not math.isfinite(x + y + start):
            found[0, car] = found[1, car] = math.nan
            continue
        node, least = int(start), math.inf
        for k in range(int(start), int(start) + 2 * either + 1):
            dx, dy = nodes[0, k] - x, nodes[1, k] - y
            away = dx * dx + dy * dy
            if away < least:
                node, least = k, away
        # The node's own tangent decides between the segment before and the one after.
        if (x - nodes[0, node]) * nodes[3, node] < (y - nodes[1, node]) * nodes[2, node]:
            node -= 1
        node = min(max(node, 0), last - 1)
        dx, dy = x - segments[0, node], y - segments[1, node]
        share = dx * segments[2, node] + dy * segments[4, node]
        found[0, car] = min(max(share, 0.0), 1.0) + segments[6, node]
        found[1, car] = dx * segments[3, node] + dy * segments[5, node]


@kernel(
    types.void, _IN_ROWS, _IN_ROWS, _IN, _IN, _IN, _IN, _TABLE, REAL, REAL, REAL, REAL,
    types.UniTuple(REAL, 8), _OUT, _OUT,
)  # fmt: skip
def curve(
    states: Array, heading: Array, arc_m: Array, offset_m: Array, desired_offset_m: Array,
    speed_factor: Array, table: Array, first_arc_m: float, wheelbase_m: float,
    max_angle_rad: float, max_rate_radps: float, tracking: tuple[float, ...],
    accel: Array, angle: Array,
) -> None:  # fmt: skip
    """Fill tyre angles (S,) of pure pursuit, and accelerations (S,) that curves allow.

    `states` (8, S); `table` (10, M) as of `FrenetPath`.
    """
    (
        look_s, look_m, kept_m, look_aside, most_lateral, turn_rad, wheel_lateral, curve_s,
    ) = tracking  # fmt: skip
    last = table.shape[1] - 1
    steepest = math.tan(max_angle_rad)
    for car in range(states.shape[1]):
        speed = max(states[3, car], 0.0)
        aside = abs(offset_m[car] - desired_offset_m[car])
        ahead = max(look_s * speed, look_m) + look_aside * max(aside - kept_m, 0.0)
        place = arc_m[car] + ahead - first_arc_m
        if not math.isfinite(place):
            accel[car] = angle[car] = math.nan
            continue
        node = int(place)
        share = place - node
        node = min(node, last)
        left = desired_offset_m[car]
        goal_x = table[0, node] + share * table[5, node]
        goal_y = table[1, node] + share * table[6, node]
        goal_x += left * (table[2, node] + share * table[7, node])
        goal_y += left * (table[3, node] + share * table[8, node])
        # Pure pursuit: tan δ = 2 L y / d².
        dx, dy = goal_x - states[0, car], goal_y - states[1, car]
        cos, sin = heading[0, car], heading[1, car]
        slope = 2.0 * wheelbase_m * (cos * dy - sin * dx) / (dx * dx + dy * dy + 1e-9)
        fast = max(states[3, car], 1.0)
        most = min(wheelbase_m * most_lateral / (fast * fast), steepest)
        wanted = math.atan(min(max(slope, -most), most))
        # The curvature ahead.
        place = arc_m[car] + curve_s * speed - first_arc_m
        node = int(place)
        share = place - node
        node = min(node, last)
        allowed = (table[4, node] + share * table[9, node]) * speed_factor[car]
        # That of the wheels on their way.
        present = states[6, car]
        bend = math.tan(max(abs(present), abs(wanted))) + 1e-6 * wheelbase_m
        turned = (abs(present - wanted) + 1e-6 * max_rate_radps) * bend
        allowed = min(allowed, math.sqrt(wheel_lateral * wheelbase_m / bend))
        allowed = min(allowed, turn_rad * wheelbase_m * max_rate_radps / turned)
        accel[car] = (allowed - speed) / curve_s
        angle[car] = wanted


@kernel(types.void, _IN_ROWS, _IN, _IN, _IN, REAL, _OUT)
def free_road(
    states: Array, wished_mps: Array, wished_mps2: Array, exponent: Array, comfort_mps2: float,
    accel: Array,
) -> None:  # fmt: skip
    """Lower accelerations (S,) to those of the intelligent-driver model on a free road."""
    for car in range(len(accel)):
        ratio = max(states[3, car], 0.0) / wished_mps[car]
        if ratio < 1.0:
            square = ratio * ratio
            free = wished_mps2[car] * (1.0 - square * square)
        else:
            free = comfort_mps2 * (ratio ** exponent[car] - 1.0)
        accel[car] = min(accel[car], free)


@kernel(
    types.void, _IN, _IN, _IN, _IN, _IN_ROWS, _IN_ROWS, _IN_ROWS, types.UniTuple(REAL, 5), _IN,
    _OUT_ROWS, _OUT_ROWS, _OUT_ROWS, _OUT_ROWS, _OUT, _OUT,
)  # fmt: skip
def forces(
    accel: Array, speed: Array, grip_square: Array, least_square: Array, transfer: Array,
    axles_kg: Array, stiffness: Array, constants: tuple[float, ...], gear: Array,
    damping: Array, low: Array, high: Array, drive_n: Array, along_low: Array, along_high: Array,
) -> None:  # fmt: skip
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


@kernel(types.void, _IN, _OUT, REAL, _OUT_ROWS)
def ramp(angle: Array, command: Array, step_rad: float, steer: Array) -> None:
    """Fill `steer` (steps, S) from the last `command` (S,) towards `angle`, and keep the end."""
    for car in range(len(command)):
        begin = command[car]
        change = angle[car] - begin
        for step in range(steer.shape[0]):
            reach = step_rad * (step + 1.0)
            steer[step, car] = begin + max(min(change, reach), -reach)
        command[car] = steer[-1, car]


@kernel(types.void, _IN_ROWS, REAL, REAL, _OUT_ROWS, _OUT_ROWS)
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


@kernel(types.boolean, _IN_ROWS, _IN)
def all_sane(states: Array, most: Array) -> bool:
    """Whether no column of `states` (8, S) is beyond its bound (8,)."""
    for column in range(states.shape[0]):
        for car in range(states.shape[1]):
            if not abs(states[column, car]) < most[column]:
                return False
    return True


@kernel(types.void, _TABLE, _TABLE, _LINE, _LINE, _OUT_ROWS)
def cheapest_walks(x: Array, y: Array, to_x: Array, to_y: Array, found: Array) -> None:
    """Fill `found` (2, S) with Fréchet and warping distances of curves (S, N) from (M,) points."""
    columns = len(to_x)
    widest, total = np.empty(columns), np.empty(columns)
    for curve_of in range(x.shape[0]):
        for i in range(x.shape[1]):
            widest_before = total_before = math.inf  # of the row before, one column before
            widest_left = total_left = math.inf
            for j in range(columns):
                dx, dy = x[curve_of, i] - to_x[j], y[curve_of, i] - to_y[j]
                away = math.sqrt(dx * dx + dy * dy)
                if i == 0 and j == 0:
                    most, least = 0.0, 0.0
                elif i == 0:
                    most, least = widest_left, total_left
                else:
                    most = min(widest_left, widest[j], widest_before)
                    least = min(total_left, total[j], total_before)
                widest_before, total_before = widest[j], total[j]
                widest_left = widest[j] = max(most, away)
                total_left = total[j] = least + away
        found[0, curve_of], found[1, curve_of] = widest[-1], total[-1]
