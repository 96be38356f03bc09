"""What a column can be: by which signal of the motion it is known, in which units, how plainly.

A role is taken where the column follows its signal, by a size that one of the units explains, and
no other role explains it as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Indices
from foretwin.telemetry.logs import units
from foretwin.telemetry.logs.declare.likeness import SURE, Likeness, likeness
from foretwin.telemetry.logs.declare.motion import GRID_S, MOVES_MPS, GridMotion

TYRE_PER_CURVATURE = (2.0, 4.2)
"""Wheelbases in metres, and a little more for slow understeer: tyre angle for a bend of 1 m."""
WHEEL_PER_CURVATURE = (20.0, 75.0)
"""The same at the steering wheel: ratios of 9 to 20, from racks of sports cars to vans (chosen)."""


UNDERSTEER_S2PM2 = (0.0, 0.0015, 0.003, 0.005)
"""A bend at speed v asks for 1 + so much times v² of the angle: from neutral cars to lorries;
0.0015 is a saloon's (0.004 rad per m/s² on 2.7 m)."""


_ODD_LEFT, _ODD_LEVEL = 0.03, 0.5
"""So little of a column stays unexplained by the speed, and so far from zero, in m/s, does it stand
where the car does, that it has to do with it whatever its size."""
_DOUBT = 2.0
"""A unit is open within so many standard deviations of the size."""
_STRAIGHT_ON_RAD = 0.1
"""So little turned between positions that are far apart, chord and way are alike to 1 %."""
_TURNED_RAD, _MOST_REVERSE = 2.6, 0.3
"""A heading that differs so much from the course is that of a car in reverse, for a smaller part of
a drive than that."""


class Role(NamedTuple):
    """A role: signals of the motion that make it, the first of which tells its size."""

    section: str
    field: str
    about: str
    """What it is held against, in words."""
    signals: Callable[[GridMotion], Array]
    sizes: Mapping[str, float]
    """By unit: what the first signal is multiplied by."""
    within: float
    """The size may be off by this, as a logarithm."""
    most_left: float
    """So much of its variance may stay unexplained."""
    level: float
    """So far from zero, in the project's units, may it be where the signal is zero."""
    lever: Callable[[GridMotion], Array] | None = None
    """What a metre between receiver and rear axle adds to the first signal."""


def _speed(motion: GridMotion) -> Array:
    return motion.speed_mps[:, None]


def _east(motion: GridMotion) -> Array:
    return (motion.speed_mps * np.cos(motion.course_rad))[:, None]


def _north(motion: GridMotion) -> Array:
    return (motion.speed_mps * np.sin(motion.course_rad))[:, None]


def _turn(motion: GridMotion) -> Array:
    return motion.turn_radps[:, None]


def _forward(motion: GridMotion) -> Array:
    return motion.accel_mps2[:, None]


def _left(motion: GridMotion) -> Array:
    return (motion.turn_radps * motion.speed_mps)[:, None]


def _steering(motion: GridMotion, understeer: float = UNDERSTEER_S2PM2[1]) -> Array:
    return (motion.curvature_pm * (1.0 + understeer * motion.speed_mps**2))[:, None]


def _bending(motion: GridMotion) -> Array:
    return motion.bending_pmps


def _winding(motion: GridMotion) -> Array:
    return motion.bending_pmps / np.maximum(motion.speed_mps, MOVES_MPS)


def _inverse(factors: Mapping[str, float]) -> dict[str, float]:
    return {unit: 1.0 / factor for unit, factor in factors.items()}


def _steering_sizes(least: float, most: float) -> dict[str, float]:
    middle = math.sqrt(least * most)
    return {unit: middle / factor for unit, factor in units.ANGLE.items()}


_ACCELERATION = {unit: 1.0 / units.ACCELERATION[unit] for unit in ("m/s2", "g")}

ROLES: tuple[Role, ...] = (
    Role("speed", "forward", "distance per time", _speed, _inverse(units.SPEED), 0.05, 0.4, 1.0),
    Role("speed", "east", "the way east per time", _east, _inverse(units.SPEED), 0.05, 0.1, 0.5),
    Role("speed", "north", "the way north per time", _north, _inverse(units.SPEED), 0.05, 0.1, 0.5),
    Role(
        "imu", "rate_z", "turning of the course", _turn, _inverse(units.ANGULAR_RATE),
        0.2, 0.5, 0.1, _bending,
    ),
    Role("imu", "accel_x", "change of speed", _forward, _ACCELERATION, 0.4, 0.7, 3.5),
    Role("imu", "accel_y", "speed times turning", _left, _ACCELERATION, 0.4, 0.6, 3.5),
    Role(
        "steering", "wheel", "bends", _steering, _steering_sizes(*WHEEL_PER_CURVATURE),
        0.5 * math.log(WHEEL_PER_CURVATURE[1] / WHEEL_PER_CURVATURE[0]), 0.4, 0.5, _winding,
    ),
    Role(
        "steering", "tire", "bends", _steering, _steering_sizes(*TYRE_PER_CURVATURE),
        0.5 * math.log(TYRE_PER_CURVATURE[1] / TYRE_PER_CURVATURE[0]), 0.4, 0.05, _winding,
    ),
)  # fmt: skip


class RoleFit(NamedTuple):
    """A column that can be `role`, in a unit: by what likeness."""

    role: Role
    column: str
    unit: str
    negate: bool
    like: Likeness

    @property
    def off(self) -> float:
        """By how much the size is off what the unit says, as a share."""
        return abs(float(self.like.sizes[0])) / self.role.sizes[self.unit] - 1.0


def fits_of(
    motion: GridMotion, column: str, values: Array, roles: tuple[Role, ...]
) -> list[RoleFit]:
    """Return the roles that a column (G,) on the grid can have, the likeliest first."""
    found = []
    steered = _steered(motion, values) if any(one.section == "steering" for one in roles) else None
    for role in roles:
        if role.field == "forward":
            like = likeness(without_reverse(values), role.signals(motion))
        else:
            like = steered if role.section == "steering" else likeness(values, role.signals(motion))
        if like is None or like.chance < SURE or like.left > role.most_left:
            continue
        size = float(like.sizes[0])
        if role.field == "forward":
            # Speeds have no level: what they are at a standstill is no other unit.
            size = _speed_size(motion, values)
            if size == 0.0:
                continue
        # Noise of positions makes sizes too small, by no more than what it leaves unexplained.
        most = 0.0 if role.section == "speed" else -math.log1p(-like.left)
        beyond = {
            unit: _beyond(math.log(abs(size) / want), most) for unit, want in role.sizes.items()
        }
        unit = min(beyond, key=lambda one: beyond[one])
        if beyond[unit] > role.within:
            continue
        if abs(float(like.sizes[-1])) > role.level * role.sizes[unit] * _scale(role):
            continue
        # Feet per second are km/h but for a tenth: where a size is that rough, both are open.
        open_units = [unit]
        if role.field == "forward":
            open_units += [
                one for one in beyond if one != unit and beyond[one] < _DOUBT * like.size_doubt
            ]
        found += [RoleFit(role, column, one, size < 0.0, like) for one in open_units]
    return sorted(found, key=lambda fit: fit.like.left)


def _steered(motion: GridMotion, values: Array) -> Likeness | None:
    """Return the likeness to the steering of the car whose understeer leaves least."""
    each = [likeness(values, _steering(motion, one)) for one in UNDERSTEER_S2PM2]
    return min(filter(None, each), key=lambda like: like.left, default=None)


def without_reverse(speed: Array) -> Array:
    """Return speeds as positions tell them: a car that reverses is as fast as one that does not."""
    return np.abs(speed)


def _speed_size(motion: GridMotion, values: Array) -> float:
    """Return a speed column's size per m/s, negative where it is so most of the way.

    0 where nothing is known of it while the car moves.
    """
    both = np.isfinite(values) & motion.moves
    if not both.any():
        return 0.0
    if motion.sparse:
        # What is cut off between positions is nothing where the car goes straight on.
        turned_rad = np.abs(motion.turn_radps) * motion.half * GRID_S
        straight = both & (turned_rad < _STRAIGHT_ON_RAD)
        both = straight if straight.any() else both
    size = float(np.median(np.abs(values[both]) / motion.speed_mps[both]))
    return -size if float(np.sum(values[both])) < 0.0 else size


def odd_speed(motion: GridMotion, values: Array) -> str | None:
    """Return in words how a column (G,) goes with the speed, but is it in none of its units."""
    like = likeness(without_reverse(values), motion.speed_mps[:, None])
    if like is None or like.chance < SURE or like.left > _ODD_LEFT:
        return None
    size = abs(_speed_size(motion, values))
    if abs(float(like.sizes[-1])) > _ODD_LEVEL * size:
        return None
    factors = {unit: size * factor for unit, factor in units.SPEED.items()}
    unit = min(factors, key=lambda one: abs(math.log(max(factors[one], 1e-12))))
    return (
        f"goes with the way per time (r = {math.sqrt(1.0 - like.left):.4f}), but is"
        f" {factors[unit]:.3g} times what {unit} would be: something else, or the unit of positions"
        " or of time is another than said below"
    )


def _beyond(off: float, most: float) -> float:
    """Return how far 0 is from what `off` is where noise made it smaller by up to `most`."""
    return max(off, -off - most, 0.0)


def _scale(role: Role) -> float:
    """Return what brings a steering size, which holds a wheelbase, back to its unit."""
    if role.section != "steering":
        return 1.0
    least, most = WHEEL_PER_CURVATURE if role.field == "wheel" else TYRE_PER_CURVATURE
    return 1.0 / math.sqrt(least * most)


class HeadingFit(NamedTuple):
    """A column that is an angle of the car: unit, way of growing, and what to add to it.

    `offset_rad` is added to the angle, which then counts from east.
    """

    column: str
    unit: str
    clockwise: bool
    offset_rad: float
    spread_rad: float
    other_spread_rad: float
    """Were it growing the other way."""
    late_s: float
    reverse_s: float
    """So long the car drove backwards by it."""


def heading_of(motion: GridMotion, column: str, angle: Array, lates: Indices) -> HeadingFit | None:
    """Return how a column (G,), NaN where unknown, is an angle of the course, or None.

    `angle` must be unwrapped in its own unit; `lates` are the shifts in ticks to try.
    """
    found = []
    for unit, factor in units.ANGLE.items():
        for sign in (1.0, -1.0):
            best = (math.inf, 0.0, 0, 0.0)
            for late in lates.tolist():
                mine = angle[max(late, 0) : len(angle) + min(late, 0)] * factor * sign
                course = motion.course_rad[max(-late, 0) : len(angle) - max(late, 0)]
                both = np.isfinite(mine) & np.isfinite(course)
                if both.sum() < 160:
                    continue
                left = np.exp(1j * (course[both] - mine[both]))
                middle = np.mean(left)
                off = np.angle(left * np.conj(middle))
                back = np.abs(off) > _TURNED_RAD
                if 0.0 < back.mean() < _MOST_REVERSE:
                    off = np.where(back, off - np.copysign(math.pi, off), off)
                spread = float(np.sqrt(np.mean(np.clip(off, -0.5, 0.5) ** 2)))
                best = min(
                    best, (spread, float(np.angle(middle)), late, float(back.sum()) * GRID_S)
                )
            found.append((*best, unit, sign))
    spread, offset, late, reverse_s, unit, sign = min(found)
    if not math.isfinite(spread):
        return None
    other = min(one[0] for one in found if one[4] == unit and one[5] == -sign)
    next_unit = min(one[0] for one in found if one[4] != unit)
    known = motion.course_rad[np.isfinite(motion.course_rad) & np.isfinite(angle)]
    swings = float(np.std(known)) if len(known) else 0.0
    if spread > 0.14 or spread > 0.4 * min(other, next_unit, swings):
        return None
    return HeadingFit(column, unit, sign < 0, offset, spread, other, late * GRID_S, reverse_s)
