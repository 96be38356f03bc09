"""Reference drivers of UN Regulation No. 157: would a competent, careful one have prevented it?

Both are for what that regulation knows: somebody cuts in or brakes ahead on the car's own course.
Tables and formulas were read in an optical reading of its text (Annex 4, Appendix 3, Table 1 of
E/ECE/TRANS/505/Rev.3/Add.156; Amendment 4 for the second performance model); numbers of which that
reading has the symbol alone are those of the Joint Research Centre's program JRC-FSM, and say so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.sim_worker.analysis.occurred.scene import STEP_S
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2

WANDERS_M = 0.375
"""Table 1: who is farther than this from the middle of its lane is perceived to leave it."""
EVALUATES_S, REACTS_S = 0.4, 0.75
"""Table 1: how long the risk is evaluated, and from then until braking begins."""
FULL_MPS2, JERK_S = 0.774 * GRAVITY_MPS2, 0.6
"""Table 1: what is braked with in the end on a dry road, and how long it takes to get there."""
COMFORT_MPS2, HARD_MPS2, OTHER_HARD_MPS2, MARGIN_M = 4.0, 6.0, 7.0, 2.0
"""b_ego,comf, b_ego,max, b_cut-in,max and d1 of the fuzzy model: the formulas are the regulation's,
the numbers JRC-FSM's."""
_LATE_S = 0.1
"""Formula 2 of Amendment 4: who comes so much later than the car is past is no danger."""


class Ahead(NamedTuple):
    """Somebody on the car's course at K rows, `STEP_S` apart, from when it is watched.

    `arc_m` of its rear along that course, `speed_mps` along it, `beside_m` between both outlines
    sideways (0 or less: in the way), `comes_mps` how fast that falls; `length_m` of both boxes.
    """

    arc_m: Array
    speed_mps: Array
    beside_m: Array
    comes_mps: Array
    length_m: float


class Outcome157(NamedTuple):
    """What became of a reference driver: whether it touched, and the least distance that was left
    in metres while the other was in its way; infinite where it never was."""

    collided: bool
    least_gap_m: float


def careful_driver(
    ahead: Ahead, *, front_m: float, speed_mps: float, perceived_row: int
) -> Outcome157:
    """Play the first performance model: full braking after perception, evaluation and reaction.

    The car's front is at `front_m` of the course at row 0 and keeps `speed_mps` until then.
    """
    begins_s = perceived_row * STEP_S + EVALUATES_S + REACTS_S
    ramp = FULL_MPS2 / JERK_S

    def decel_mps2(row: int, _speed: float, _gap: float, _last: float) -> float:
        return float(np.clip(((row + 0.5) * STEP_S - begins_s) * ramp, 0.0, FULL_MPS2))

    return _played(ahead, front_m, speed_mps, decel_mps2)


def fuzzy_driver(ahead: Ahead, *, front_m: float, speed_mps: float) -> Outcome157:
    """Play the second performance model, the fuzzy safety model: it brakes as gently as is safe.

    The reaction time passes once, from when a danger is first seen; its jerk is the first model's.
    """
    ramp = FULL_MPS2 / JERK_S
    waited_s = 0.0

    def decel_mps2(row: int, speed: float, gap: float, last: float) -> float:
        nonlocal waited_s
        other = float(ahead.speed_mps[row])
        if not _endangers(ahead, row, speed, gap):
            return 0.0
        critical = critical_safety(gap, speed, other, -last)
        proactive = proactive_safety(gap, speed, other)
        if critical + proactive <= 0.0:
            return 0.0
        if waited_s < REACTS_S:
            waited_s += STEP_S
            return 0.0
        wanted = critical * (HARD_MPS2 - COMFORT_MPS2) + COMFORT_MPS2
        if critical <= 0.0:
            wanted = proactive * COMFORT_MPS2
        return min(last + ramp * STEP_S, FULL_MPS2, wanted)

    return _played(ahead, front_m, speed_mps, decel_mps2)


def proactive_safety(gap_m: float, ego_mps: float, other_mps: float) -> float:
    """Return PFS, 0 for safe to 1 for unsafe: Amendment 4, formulas 3 and 4."""
    stops = other_mps**2 / (2.0 * OTHER_HARD_MPS2)
    safe = ego_mps * REACTS_S + ego_mps**2 / (2.0 * COMFORT_MPS2) - stops + MARGIN_M
    unsafe = ego_mps * REACTS_S + ego_mps**2 / (2.0 * HARD_MPS2) - stops
    return _membership(gap_m - MARGIN_M, safe, unsafe)


def critical_safety(gap_m: float, ego_mps: float, other_mps: float, accel_mps2: float) -> float:
    """Return CFS, 0 for safe to 1 for unsafe: Amendment 4, formulas 5 to 7.

    `accel_mps2` is the car's, negative where it brakes.
    """
    if ego_mps <= other_mps:
        return 0.0
    held = max(accel_mps2, -COMFORT_MPS2)
    then = ego_mps + held * REACTS_S
    closing = ego_mps - other_mps
    if then <= other_mps:
        return float(gap_m < closing**2 / (2.0 * abs(accel_mps2)))
    nearer = ((ego_mps + then) / 2.0 - other_mps) * REACTS_S
    safe = nearer + (then - other_mps) ** 2 / (2.0 * COMFORT_MPS2)
    unsafe = nearer + (then - other_mps) ** 2 / (2.0 * HARD_MPS2)
    return _membership(gap_m, safe, unsafe)


def _membership(gap_m: float, safe_m: float, unsafe_m: float) -> float:
    if gap_m >= safe_m:
        return 0.0
    if gap_m < unsafe_m:
        return 1.0
    return (gap_m - safe_m) / (unsafe_m - safe_m)


def _endangers(ahead: Ahead, row: int, speed: float, gap: float) -> bool:
    """Whether somebody is in the way, or will be before the car is past: formula 2."""
    beside, comes = float(ahead.beside_m[row]), float(ahead.comes_mps[row])
    if beside <= 0.0:
        return True
    closing = speed - float(ahead.speed_mps[row])
    if comes <= 0.0 or closing <= 0.0:
        return False
    return beside / comes < (gap + ahead.length_m) / closing + _LATE_S


def _played(
    ahead: Ahead,
    front_m: float,
    speed_mps: float,
    decel_of: Callable[[int, float, float, float], float],
) -> Outcome157:
    """Drive along the course with a deceleration for each row; once past, nobody is touched."""
    front, speed, last, least = front_m, speed_mps, 0.0, np.inf
    in_way: Flags = ahead.beside_m <= 0.0
    for row in range(len(ahead.arc_m)):
        gap = float(ahead.arc_m[row]) - front
        if gap < -ahead.length_m:
            break
        if in_way[row]:
            least = min(least, gap)
            if gap <= 0.0:
                return Outcome157(True, 0.0)
        last = decel_of(row, speed, gap, last)
        after = max(speed - last * STEP_S, 0.0)
        front, speed = front + (speed + after) / 2.0 * STEP_S, after
    return Outcome157(False, float(least))
