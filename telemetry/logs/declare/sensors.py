"""What the columns beside time and place are: speed, heading, inertial unit, steering.

Speed, heading and turning are held against positions. What is found so is the better reference for
what changes faster: forces and steering.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs import units
from foretwin.telemetry.logs.declare.likeness import Lateness, lateness
from foretwin.telemetry.logs.declare.motion import GRID_S, MOVES_MPS, GridMotion, changes, on_grid
from foretwin.telemetry.logs.declare.names import COMMANDED
from foretwin.telemetry.logs.declare.places import Place
from foretwin.telemetry.logs.declare.roles import (
    ROLES,
    HeadingFit,
    RoleFit,
    fits_of,
    heading_of,
    odd_speed,
    without_reverse,
)

_FINER_HALF = round(0.4 / GRID_S)
_PLAINLY = 1.3
"""Another reading must leave so many times as much of a column unexplained, else both are open."""
_LEAST_CHANGES = 12
_LATE_TICKS = np.arange(-24, 25, 4)
_GRAVITY_WITHIN = 0.08
_LEAST_REVERSE_S = 1.0


class ChangingColumn(NamedTuple):
    """A column where it changes: times and values (K,)."""

    time_s: Array
    values: Array


class FoundSensors(NamedTuple):
    """What was found, by section and field; `late` by section. `others` could be the same.

    `doubts` are columns that could be several things, each said in words; `notes` what is not as
    it should be with columns that are taken.
    """

    fits: dict[str, RoleFit]
    heading: HeadingFit | None
    late: dict[str, Lateness]
    gravity: tuple[str, float] | None
    """The column that gravity is in, and its mean in g."""
    others: dict[str, list[str]]
    doubts: dict[str, str]
    notes: list[str]


def measured_first(fit: RoleFit) -> tuple[bool, float]:
    """Return what to sort fits of one role by: what was measured, then what fits better."""
    return bool(COMMANDED.search(fit.column)), fit.like.left


def columns_beside(
    columns: dict[str, Array], time_s: Array, without: set[str]
) -> dict[str, ChangingColumn]:
    """Return the columns that change and are none of `without`."""
    found = {}
    for name, values in columns.items():
        rows = changes([np.where(np.isfinite(time_s), values, np.nan)])
        if name not in without and len(rows) >= _LEAST_CHANGES:
            found[name] = ChangingColumn(time_s[rows], values[rows])
    return found


def sensors_of(place: Place, beside: dict[str, ChangingColumn]) -> FoundSensors:
    """Return which columns are sensors of the car, by where it was."""
    motion = place.motion
    fits, others, doubts = _taken(motion, beside, {"speed", "imu.rate_z"})
    heading = _heading(motion, beside)
    late: dict[str, Lateness] = {}
    if (speed := fits.get("speed.forward")) is not None:
        _add_late(late, "speed", motion, speed, beside)
    turn = fits.get("imu.rate_z")
    finer = motion
    if heading is not None:
        finer = _turning_as(finer, _heading_rate(motion, beside, heading), heading.late_s)
    elif turn is not None:
        finer = _turning_as(finer, *_sensed(motion, beside, turn, 0.0))
    if speed is not None:
        finer = _fast_as(finer, *_sensed(motion, beside, speed, late["speed"].late_s))
    more, more_others, more_doubts = _taken(finer, _less(beside, fits), {"imu", "steering"})
    # A turning rate is plainer against headings than against positions, and the other way round.
    fits = {**more, **fits} if turn is not None else {**fits, **more}
    if "imu.rate_z" in more and turn is None:
        finer = _turning_as(finer, *_sensed(finer, beside, more["imu.rate_z"], 0.0))
        again, _, more_doubts = _taken(finer, _less(beside, fits), {"imu", "steering"})
        fits |= {key: fit for key, fit in again.items() if key not in fits}
    for section in ("imu", "steering"):
        first = next((fit for key, fit in fits.items() if key.startswith(section)), None)
        chosen = fits.get("imu.rate_z") if section == "imu" else first
        if chosen is not None:
            _add_late(late, section, motion, chosen, beside)
    if heading is not None:
        late["heading"] = _heading_late(motion, beside, heading)
    used = {fit.column for fit in fits.values()}
    doubts = {name: said for name, said in (doubts | more_doubts).items() if name not in used}
    others = {key: names for key, names in (others | more_others).items() if key in fits}
    if speed is None:
        for name, column in _less(beside, fits).items():
            odd = odd_speed(motion, on_grid(motion, column.time_s, column.values))
            doubts |= {} if odd is None else {name: odd}
    notes = _never_backwards(beside, speed, heading) + [
        f"{fit.column}: by its name this is what was wanted, not what then was"
        for fit in fits.values()
        if COMMANDED.search(fit.column)
    ]
    return FoundSensors(fits, heading, late, _gravity(beside, fits), others, doubts, notes)


def _never_backwards(
    beside: dict[str, ChangingColumn], speed: RoleFit | None, heading: HeadingFit | None
) -> list[str]:
    """Return what to say where the heading tells of driving backwards, and the speed does not."""
    if speed is None or heading is None or heading.reverse_s < _LEAST_REVERSE_S:
        return []
    values = beside[speed.column].values * (-1.0 if speed.negate else 1.0)
    if values.min() < -0.1 * values.max():
        return []
    return [
        f"{speed.column}: never negative, though by {heading.column} the car drove backwards for"
        f" {heading.reverse_s:.0f} s: told forwards there"
    ]


def _less(beside: dict[str, ChangingColumn], fits: dict[str, RoleFit]) -> dict[str, ChangingColumn]:
    used = {fit.column for fit in fits.values()}
    return {name: column for name, column in beside.items() if name not in used}


def _taken(
    motion: GridMotion, beside: dict[str, ChangingColumn], wanted: set[str]
) -> tuple[dict[str, RoleFit], dict[str, list[str]], dict[str, str]]:
    """Return the best fit of each role, the next best columns, and columns that are not plain."""
    by_role: dict[str, list[RoleFit]] = {}
    doubts = {}
    for name, column in beside.items():
        fits = fits_of(motion, name, on_grid(motion, column.time_s, column.values), ROLES)
        if any(fit.role.field == "forward" for fit in fits):
            # Where all goes one way, that way's part of the speed is the speed.
            fits = [fit for fit in fits if fit.role.field not in ("east", "north")
                    or fit.like.left * _PLAINLY < _left_forward(fits)]  # fmt: skip
        if not fits:
            continue
        best = fits[0]
        key = f"{best.role.section}.{best.role.field}"
        if key not in wanted and best.role.section not in wanted:
            continue
        rivals = [fit for fit in fits[1:] if not best.like.plainer_than(fit.like)]
        if rivals:
            names = " or ".join(
                f"{fit.role.section}.{fit.role.field} in {fit.unit}" for fit in (best, *rivals)
            )
            doubts[name] = f"{names}: the drive does not tell these apart"
            continue
        by_role.setdefault(key, []).append(best)
    others = {}
    for key, rows in by_role.items():
        rows.sort(key=measured_first)
        others[key] = [fit.column for fit in rows[1:]]
    return {key: rows[0] for key, rows in by_role.items()}, others, doubts


def _left_forward(fits: list[RoleFit]) -> float:
    return min(fit.like.left for fit in fits if fit.role.field == "forward")


def _sensed(
    motion: GridMotion, beside: dict[str, ChangingColumn], fit: RoleFit, late_s: float
) -> tuple[Array, float]:
    """Return a found column in the project's unit, smoothed less than positions are."""
    factor = 1.0 / fit.role.sizes[fit.unit]
    level = 0.0 if fit.role.section == "speed" else float(fit.like.sizes[-1])
    finer = motion._replace(half=min(_FINER_HALF, motion.half))
    column = beside[fit.column]
    values = on_grid(finer, column.time_s, column.values) - level
    return (-factor if fit.negate else factor) * values, late_s or fit.like.late_s


def _heading_rate(
    motion: GridMotion, beside: dict[str, ChangingColumn], heading: HeadingFit
) -> Array:
    finer = motion._replace(half=min(_FINER_HALF, motion.half))
    angle = on_grid(finer, *_angle(beside, heading))
    rate = savgol_filter(angle, 2 * finer.half + 1, 2, deriv=1, delta=GRID_S, mode="nearest")
    return np.asarray(-rate if heading.clockwise else rate)


def _angle(beside: dict[str, ChangingColumn], heading: HeadingFit) -> ChangingColumn:
    column = beside[heading.column]
    factor = units.ANGLE[heading.unit]
    return ChangingColumn(column.time_s, np.unwrap(column.values * factor))


def _turning_as(motion: GridMotion, rate: Array, late_s: float) -> GridMotion:
    rate = _earlier(rate, late_s)
    turn = np.where(motion.moves, rate, np.nan)
    return motion._replace(half=min(_FINER_HALF, motion.half), turn_radps=turn)


def _fast_as(motion: GridMotion, speed: Array, late_s: float) -> GridMotion:
    speed = _earlier(speed, late_s)
    moves = speed > MOVES_MPS
    half = min(_FINER_HALF, motion.half)
    accel = savgol_filter(speed, 2 * half + 1, 2, deriv=1, delta=GRID_S, mode="nearest")
    return motion._replace(
        half=half,
        moves=moves,
        speed_mps=speed,
        turn_radps=np.where(moves, motion.turn_radps, np.nan),
        accel_mps2=np.where(moves, accel, np.nan),
    )


def _earlier(values: Array, late_s: float) -> Array:
    ticks = np.arange(len(values)) * GRID_S
    return np.asarray(np.interp(ticks + late_s, ticks, values, left=np.nan, right=np.nan))


def _heading(motion: GridMotion, beside: dict[str, ChangingColumn]) -> HeadingFit | None:
    found = []
    for name, column in beside.items():
        for unit, turn in (("rad", 2.0 * np.pi), ("deg", 360.0)):
            if np.ptp(column.values) > 1.3 * turn:
                continue
            angle = on_grid(motion, column.time_s, np.unwrap(column.values, period=turn))
            fit = heading_of(motion, name, angle, _LATE_TICKS)
            if fit is not None and fit.unit == unit:
                found.append(fit)
                break
    return min(found, key=lambda fit: fit.spread_rad, default=None)


def _heading_late(
    motion: GridMotion, beside: dict[str, ChangingColumn], heading: HeadingFit
) -> Lateness:
    angle = on_grid(motion, *_angle(beside, heading))
    turned = -angle if heading.clockwise else angle
    found = lateness(
        motion, turned, motion.course_rad[:, None], size=1.0, lever=motion.curvature_pm
    )
    return found or Lateness(0.0, np.inf)


def _add_late(
    late: dict[str, Lateness],
    section: str,
    motion: GridMotion,
    fit: RoleFit,
    beside: dict[str, ChangingColumn],
) -> None:
    column = beside[fit.column]
    values = on_grid(motion, column.time_s, column.values)
    values = without_reverse(values) if fit.role.field == "forward" else values
    lever = None if fit.role.lever is None else fit.role.lever(motion)
    size = float(fit.like.sizes[0])
    found = lateness(motion, values, fit.role.signals(motion), size=size, lever=lever)
    late[section] = found or Lateness(0.0, np.inf)


def _gravity(
    beside: dict[str, ChangingColumn], fits: dict[str, RoleFit]
) -> tuple[str, float] | None:
    """Return the accelerometer that stands upright, in the unit of the one that looks forward."""
    forward = fits.get("imu.accel_x")
    if forward is None:
        return None
    used = {fit.column for fit in fits.values()}
    per_g = units.ACCELERATION[forward.unit] / units.STANDARD_GRAVITY_MPS2
    for name, column in beside.items():
        mean_g = float(np.mean(column.values)) * per_g
        spread = float(np.std(column.values)) * per_g
        as_often = len(column.values) > 0.5 * len(beside[forward.column].values)
        upright = abs(abs(mean_g) - 1.0) < _GRAVITY_WITHIN and spread < 0.3
        if name not in used and upright and as_often:
            return name, mean_g
    return None
