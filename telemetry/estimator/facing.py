"""Which way a car faces where positions alone tell of it: it may have begun to back, or be lost."""

from __future__ import annotations

import math

from foretwin.geometry.steering import MAX_CURVATURE_PM
from foretwin.telemetry.estimator.filter_state import SPEED, YAW
from foretwin.telemetry.estimator.kinematic_filter import KinematicFilter
from foretwin.telemetry.estimator.position_gate import PositionGate
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

CREEPING_MPS, BACKING_MPS = 1.0, 0.3
_BACKED_M = 0.3
_WITHIN_S = 3.0
_TURNED_RAD, _BACKWARDS_RAD = 1.75, 2.5
"""No car turns by the first within a metre: its heading was wrong; from the second on it backs."""
_KNOWN_YAW_STD = 0.15
FASTEST_REVERSE_MPS, _LONGEST_REVERSE_M = 3.0, 15.0
"""A car that positions show going faster or farther backwards was facing that way. Chosen."""


class Facing:
    """Remembers how the car faced at the last fix that counted, and how far it has backed since."""

    def __init__(self, gate: PositionGate) -> None:
        self._gate = gate
        self._reversed_m = 0.0
        self._yaw_rad, self._yaw_std_rad = 0.0, math.inf

    def copy(self, gate: PositionGate) -> Facing:
        """Return another one that reads the fixes in `gate`."""
        other = shallow_copy(self)
        other._gate = gate
        return other

    def take(self, filter_: KinematicFilter) -> None:
        """Remember the heading, as a fix has just corrected it."""
        self._yaw_rad = filter_.mean.item(YAW)
        self._yaw_std_rad = math.sqrt(filter_.covariance.item(YAW, YAW))

    def goes_sideways(self, white_m: float) -> bool:
        """Whether no car that faced so at the last fix can go where the one of now is.

        The chord of the tightest bend lies half its curvature times its length squared off the way.
        """
        fixes = self._gate.recent
        if len(fixes) < 2 or self._yaw_std_rad > _KNOWN_YAW_STD:
            return False
        x, y = (fixes[-1].xy_m - fixes[-2].xy_m).tolist()
        length_m = math.hypot(x, y)
        across_m = abs(math.cos(self._yaw_rad) * y - math.sin(self._yaw_rad) * x)
        reach_m = 0.5 * MAX_CURVATURE_PM * length_m**2 + 3.0 * self._yaw_std_rad * length_m
        return bool(across_m > reach_m + 4.0 * white_m)

    def reverse(self, filter_: KinematicFilter, speed_mps: float) -> None:
        """Let the car go the other way from now on, facing as it does."""
        self._reversed_m = 0.0
        filter_.reverse(speed_mps)

    def turned(self, filter_: KinematicFilter, yaw_before: float, std_m: float) -> float | None:
        """Return the course to begin anew along where positions go against the heading."""
        speed_mps = filter_.mean.item(SPEED)
        if filter_.may_reverse:
            self._reversed_m += self._gate.last_step_m
            if speed_mps > 0.5 * CREEPING_MPS:
                filter_.may_reverse = False
            elif speed_mps < -FASTEST_REVERSE_MPS or self._reversed_m > _LONGEST_REVERSE_M:
                return self._long_course(std_m)
            return None
        known = filter_.covariance.item(YAW, YAW) < _KNOWN_YAW_STD**2
        backed = self.backed_course(std_m) if known else None
        if known and backed is None:
            return None
        if (
            backed is not None
            and speed_mps < BACKING_MPS
            and abs(math.remainder(backed - yaw_before, math.tau)) > _BACKWARDS_RAD
        ):
            self.reverse(filter_, -self._gate.speed_mps())
            return None
        course = self._long_course(std_m)
        if course is None or abs(math.remainder(course - yaw_before, math.tau)) <= _TURNED_RAD:
            return None
        return course

    def backed_course(self, std_m: float) -> float | None:
        """Return the course of the shortest way that fixes good to `std_m` show."""
        return self._gate.course(_BACKED_M + 5.0 * std_m, within_s=_WITHIN_S)

    def _long_course(self, std_m: float) -> float | None:
        return self._gate.course(1.0 + 5.0 * std_m, within_s=_WITHIN_S)
