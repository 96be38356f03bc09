"""Sensors that were found as sections of a declaration, with what proves each."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.logs.declaration import (
    Column,
    HeadingSection,
    ImuSection,
    SpeedSection,
    SteeringSection,
)
from foretwin.telemetry.logs.declare.likeness import Lateness
from foretwin.telemetry.logs.declare.motion import MOVES_MPS
from foretwin.telemetry.logs.declare.places import Place
from foretwin.telemetry.logs.declare.repeats import new_when
from foretwin.telemetry.logs.declare.roles import HeadingFit, RoleFit
from foretwin.telemetry.logs.declare.sensors import FoundSensors, measured_first

_TOGETHER = 0.95
_STRAIGHT_DEG = 1.5
"""A heading so near to the course is the car's: what is left is told, and not corrected."""
_STANDS_MPS, _STEADY_DEG, _COURSE_MPS = 0.3, 5.0, 2.0


def col(name: str, unit: str, *, negate: bool = False) -> Column:
    """Return a column of a section."""
    return Column(column=name, unit=unit, negate=negate)


class Sections:
    """Makes sections of a table's columns (N,) by name; remembers which were used."""

    def __init__(self, columns: dict[str, Array], time_s: Array, speed_mps: Array) -> None:
        self.columns, self.time_s, self.speed_mps = columns, time_s, speed_mps
        self.moves = speed_mps > MOVES_MPS
        self.used: set[str] = set()

    def together(self, names: list[str]) -> bool:
        """Tell whether columns are filled in the same rows, as those of one section must be."""
        filled = np.stack([np.isfinite(self.columns[name]) for name in names])
        return bool(filled.all(axis=0).sum() > _TOGETHER * filled[0].sum())

    def of(
        self, sensors: FoundSensors, place: Place
    ) -> tuple[dict[str, Any], dict[str, list[str]], list[str]]:
        """Return sections by name, evidence by section, and what is left open."""
        made: dict[str, Any] = {}
        said: dict[str, list[str]] = {}
        unknown: list[str] = []
        for section, kind, chosen in (
            ("speed", SpeedSection, self._speed(sensors)),
            ("imu", ImuSection, self._imu(sensors, unknown)),
            ("steering", SteeringSection, self._steering(sensors)),
        ):
            if chosen:
                said[section] = [_said(fit) for fit in chosen.values()]
                given: dict[str, Any] = {
                    name: col(fit.column, fit.unit, negate=fit.negate)
                    for name, fit in chosen.items()
                }
                if section == "imu":
                    given |= self._upright(sensors, given, said[section])
                    given["axes"] = "forward-left-up"
                given |= self._rows(given, sensors.late.get(section), said[section])
                others = {n for key, ns in sensors.others.items() if key.startswith(section)
                          for n in ns}  # fmt: skip
                if others:
                    said[section].append(f"as well: {', '.join(sorted(others))}")
                made[section] = kind(**given)
            else:
                unknown.append(f"{section}: no column that is plainly one")
        if sensors.heading is None:
            unknown.append("heading: no column that is plainly one")
        else:
            made["heading"], said["heading"] = self._heading(sensors, sensors.heading, place)
            unknown += _mirrored(made["heading"], place)
        return made, said, unknown

    def _speed(self, sensors: FoundSensors) -> dict[str, RoleFit]:
        fits = sensors.fits
        if "speed.forward" in fits:
            return {"forward": fits["speed.forward"]}
        parts = {
            name: fits[f"speed.{name}"] for name in ("east", "north") if f"speed.{name}" in fits
        }
        both = len(parts) == 2 and self.together([fit.column for fit in parts.values()])
        return parts if both else {}

    def _imu(self, sensors: FoundSensors, unknown: list[str]) -> dict[str, RoleFit]:
        fits = sensors.fits
        wanted = ("accel_x", "rate_z", "accel_y")
        found = {name: fits[f"imu.{name}"] for name in wanted if f"imu.{name}" in fits}
        if "rate_z" not in found:
            unknown += [
                f"{fit.column}: {_said(fit)}; an inertial unit needs a turning rate: left out"
                for fit in found.values()
            ]
            return {}
        if "accel_x" not in found:
            # Beside a heading the rate is the heading's.
            return {} if sensors.heading is not None else {"rate_z": found["rate_z"]}
        turning, ahead = found["rate_z"].column, found["accel_x"].column
        if not self.together([turning, ahead]):
            unknown.append(
                f"imu: acceleration ({ahead}) and turning rate ({turning}) stand in different rows:"
                " left out"
            )
            return {}
        names = [fit.column for fit in found.values()]
        if not self.together(names):
            del found["accel_y"]
        return found

    def _steering(self, sensors: FoundSensors) -> dict[str, RoleFit]:
        found = [(name, sensors.fits[f"steering.{name}"]) for name in ("wheel", "tire")
                 if f"steering.{name}" in sensors.fits]  # fmt: skip
        return dict([min(found, key=lambda row: measured_first(row[1]))]) if found else {}

    def _upright(
        self, sensors: FoundSensors, given: dict[str, Any], said: list[str]
    ) -> dict[str, Column]:
        if sensors.gravity is None:
            return {}
        name, mean_g = sensors.gravity
        if "accel_x" not in given or not self.together([given["accel_x"].column, name]):
            return {}
        said.append(f"accel_z is {name}: gravity, {mean_g:+z.3f} g in the mean")
        return {"accel_z": col(name, given["accel_x"].unit, negate=mean_g < 0.0)}

    def _rows(
        self, given: dict[str, Any], late: Lateness | None, said: list[str]
    ) -> dict[str, Any]:
        """Return which rows are new and how late they are, and mark the columns as used."""
        names = [column.column for column in given.values() if isinstance(column, Column)]
        self.used.update(names)
        more: dict[str, Any] = {}
        told = new_when(names, self.columns, self.time_s, self.moves)
        if told is not None:
            more = {"new_when": told.columns, "again_s": told.again_s}
            said.append(told.evidence)
        if late is not None and late.or_more:
            said.append(
                f"late against positions by {late.late_s:+z.1f} s or more, which is as much as is "
                "tried: not corrected (late_s does it)"
            )
        elif late is None or not math.isfinite(late.std_s):
            said.append("lateness against positions: not observable")
        else:
            said.append(
                f"late against positions by {late.late_s:+z.3f} s ± {late.std_s:.3f}"
                + ("" if late.sure else ": not plain enough to correct")
            )
            if late.sure:
                more["late_s"] = round(late.late_s, 3)
        return more

    def _heading(
        self, sensors: FoundSensors, fit: HeadingFit, place: Place
    ) -> tuple[HeadingSection, list[str]]:
        sign = -1.0 if fit.clockwise else 1.0
        from_zero = {
            zero: sign * math.remainder(math.degrees(fit.offset_rad) - at_deg, 360.0)
            for zero, at_deg in (("north", 90.0), ("east", 0.0))
        }
        usual, unusual = ("north", "east") if fit.clockwise else ("east", "north")
        zero = unusual if abs(from_zero[unusual]) < _STRAIGHT_DEG else usual
        offset_deg = from_zero[zero]
        plain = abs(offset_deg) < _STRAIGHT_DEG
        direction = "clockwise" if fit.clockwise else "counterclockwise"
        said = [
            f"{fit.column} in {fit.unit}: the course {direction} from {zero}"
            f" {'within' if plain else 'and'} {offset_deg:+z.2f} deg, scatter"
            f" {math.degrees(fit.spread_rad):.2f} deg; growing the other way"
            f" {math.degrees(fit.other_spread_rad):.1f} deg and more"
        ]
        given: dict[str, Any] = {"yaw": col(fit.column, fit.unit)}
        rate = sensors.fits.get("imu.rate_z")
        taken = rate is None or rate.column in self.used
        if rate is not None and not taken and self.together([fit.column, rate.column]):
            given["yaw_rate"] = col(rate.column, rate.unit, negate=rate.negate)
            said.append(_said(rate))
        given |= self._rows(given, sensors.late.get("heading"), said)
        if not self._steady(fit):
            given["min_speed_mps"] = _COURSE_MPS
            said.append("wanders or is nought while the car stands, or was not seen standing")
        if place.frame == "projected":
            given["north"] = "grid"
        section = HeadingSection(
            zero=zero,  # type: ignore[arg-type]
            direction=direction,  # type: ignore[arg-type]
            offset_deg=0.0 if plain else round(offset_deg, 2),
            **given,
        )
        return section, said

    def _steady(self, fit: HeadingFit) -> bool:
        """Tell whether a heading stays while the car stands: else it is a course."""
        angle = self.columns[fit.column] * (1.0 if fit.unit == "deg" else 180.0 / math.pi)
        stands = (self.speed_mps < _STANDS_MPS) & np.isfinite(angle)
        pairs = stands[1:] & stands[:-1]
        if pairs.sum() < 20:
            return False
        steps = np.abs((np.diff(angle)[pairs] + 180.0) % 360.0 - 180.0)
        # What does not move at all is a course that is held: as good as none.
        lives = np.mean(steps > 0.0) > 0.1
        return bool(lives and np.percentile(steps, 99) < 1.0 and steps.max() < _STEADY_DEG)


def _mirrored(heading: HeadingSection, place: Place) -> list[str]:
    """Return what to say of a heading that grows against the compass: the track may be mirrored."""
    if heading.zero != "north" or heading.direction == "clockwise" or heading.offset_deg != 0.0:
        return []
    x = [*place.fields.values()][1 if place.frame == "wgs84" else 0]
    return [
        f"heading: that {heading.yaw.column} grows counterclockwise from north; a compass does not,"
        f" and would not here either if {x} grew to the west"
    ]


def _said(fit: RoleFit) -> str:
    size = float(fit.like.sizes[0])
    meant = f"{abs(size) / fit.role.sizes[fit.unit]:.3f} of what {fit.unit} would be"
    if fit.role.section == "steering":
        meant = f"{abs(size):.4g} {fit.unit} for a bend of 1 m, as a car's {fit.role.field} has"
    turned = ", negated" if fit.negate else ""
    like = math.sqrt(max(1.0 - fit.like.left, 0.0))
    return (
        f"{fit.role.field} is {fit.column} in {fit.unit}{turned}: against {fit.role.about} over"
        f" {fit.like.together:.0f} s r = {like:.4f}, {meant}"
    )
