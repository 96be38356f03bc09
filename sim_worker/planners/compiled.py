"""The inner part of pure pursuit and of the intelligent-driver model, compiled."""

from __future__ import annotations

import math

from foretwin.contracts.arrays import Array
from foretwin.geometry.compiled import IN, IN_ROWS, OUT, REAL, TABLE, kernel, types

_PLACES, _LIMITS, _TRACKING = [IN] * 4, types.UniTuple(REAL, 3), types.UniTuple(REAL, 8)


@kernel(types.void, IN_ROWS, IN_ROWS, *_PLACES, TABLE, REAL, _LIMITS, _TRACKING, OUT, OUT)
def curve(
    states: Array,
    heading: Array,
    arc_m: Array,
    offset_m: Array,
    desired_offset_m: Array,
    speed_factor: Array,
    table: Array,
    first_arc_m: float,
    limits: tuple[float, ...],
    tracking: tuple[float, ...],
    accel: Array,
    angle: Array,
) -> None:
    """Fill tyre angles (S,) of pure pursuit, and accelerations (S,) that curves allow.

    `states` (8, S); `table` (10, M) as of `FrenetPath`; `limits` are the wheelbase, and the most
    angle and rate of the tyres.
    """
    wheelbase_m, max_angle_rad, max_rate_radps = limits
    look_s, look_m, kept_m, look_aside = tracking[:4]
    most_lateral, turn_rad, wheel_lateral, curve_s = tracking[4:]
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


@kernel(types.void, IN_ROWS, IN, IN, IN, IN, REAL, OUT)
def free_road(
    states: Array,
    wished_mps: Array,
    change_mps2: Array,
    wished_mps2: Array,
    exponent: Array,
    comfort_mps2: float,
    accel: Array,
) -> None:
    """Lower accelerations (S,) to those of the intelligent-driver model on a free road.

    Wished speeds (S,) that change, by `change_mps2` (S,), are kept up with.
    """
    for car in range(len(accel)):
        ratio = max(states[3, car], 0.0) / wished_mps[car]
        if ratio < 1.0:
            square = ratio * ratio
            free = wished_mps2[car] * (1.0 - square * square)
        else:
            free = comfort_mps2 * (ratio ** exponent[car] - 1.0)
        accel[car] = min(accel[car], free + change_mps2[car])
