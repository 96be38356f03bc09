"""Whether a gyro turns as the car does: compared with the courses of fixes, which know no gyro.

The filter cannot tell: a gyro that is stuck, in degrees, or upside down leads the yaw along, so
that it surprises nobody. Courses are rough, so that only whole turns are compared.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

_LEAST_TURN_RAD = 1.0
_ASTRAY = 0.75
"""Of the larger of the two turns: courses that lag, or are of an antenna far ahead, part less from
a true gyro; one that is stuck, upside down or in degrees parts by all of it. Chosen."""
_TURNS = 3
"""So many more turns must be contradicted than borne out before a gyro is left out; of one that no
turn has borne out yet the first will do. Chosen."""
_LEAST_CHORD_M, _CHORD_DEVIATIONS, _LEAST_CHORD_S, _LONGEST_CHORD_S = 3.0, 15.0, 0.5, 6.0
"""Of 15 standard deviations a chord's course is good to a tenth of a radian."""
_LONGEST_TURN_S = 10.0
_LATEST_S = 3.0
"""Courses may lag behind the gyro by as much: in Dresden one receiver's do by 2 s."""
_LARGEST_BEND_RAD = 1.5
"""Between chords one after the other: more is a fix that jumped, or a car that backs."""
_LONGEST_GAP_NS = 500_000_000


class _Chord(NamedTuple):
    """Course of a stretch, summed without wrapping, and the gyro's mean angle along it."""

    time_s: float
    course_rad: float
    gyro_rad: float


class _BegunChord(NamedTuple):
    """Where and when a chord begins, and the sum of the gyro's angles at its fixes so far."""

    time_s: float
    xy_m: Array
    angles_rad: float
    fixes: int


class GyroTrust:
    """Takes yaw rates and believed fixes in the order of their stamps."""

    def __init__(self) -> None:
        self.believed = True
        """Whether the gyro's yaw rates are to be used."""
        self._stamp_ns: int | None = None
        self._rate_radps = self._angle_rad = 0.0
        self._begun: _BegunChord | None = None
        self._chords: tuple[_Chord, ...] = ()
        self._contradicted = False
        """By the latest chord."""
        self._against = _TURNS - 1

    def copy(self) -> GyroTrust:
        """Return another one that goes on from here by itself."""
        return shallow_copy(self)

    def turn(self, stamp_ns: int, rate_radps: float) -> None:
        """Go on by a yaw rate, without what is known of its bias."""
        before_ns, before_radps = self._stamp_ns, self._rate_radps
        self._stamp_ns, self._rate_radps = stamp_ns, rate_radps
        if before_ns is None or not 0 <= stamp_ns - before_ns <= _LONGEST_GAP_NS:
            self._begin()
            return
        self._angle_rad += 0.5 * (before_radps + rate_radps) * (stamp_ns - before_ns) * 1e-9

    def take(self, stamp_ns: int, xy_m: Array, std_m: float) -> None:
        """Take a believed fix at `xy_m` (2,) with white noise of `std_m`."""
        if self._stamp_ns is None or abs(stamp_ns - self._stamp_ns) > _LONGEST_GAP_NS:
            self._begin()
            return
        time_s = stamp_ns * 1e-9
        angle = self._angle_rad + self._rate_radps * (stamp_ns - self._stamp_ns) * 1e-9
        begun = self._begun
        if begun is None or time_s - begun.time_s > _LONGEST_CHORD_S:
            self._begun = _BegunChord(time_s, xy_m, angle, 1)
            return
        total, fixes = begun.angles_rad + angle, begun.fixes + 1
        x_m, y_m = (xy_m - begun.xy_m).tolist()
        least_m = max(_LEAST_CHORD_M, _CHORD_DEVIATIONS * std_m)
        if math.hypot(x_m, y_m) < least_m or time_s - begun.time_s < _LEAST_CHORD_S:
            self._begun = begun._replace(angles_rad=total, fixes=fixes)
            return
        self._begun = _BegunChord(time_s, xy_m, angle, 1)
        self._compare(0.5 * (begun.time_s + time_s), math.atan2(y_m, x_m), total / fixes)

    def _begin(self) -> None:
        self._begun, self._chords = None, ()

    def _compare(self, time_s: float, course_rad: float, gyro_rad: float) -> None:
        contradicted, self._contradicted = self._contradicted, False
        if self._chords:
            last_rad = self._chords[-1].course_rad
            bend = math.remainder(course_rad - last_rad, math.tau)
            if abs(bend) > _LARGEST_BEND_RAD:
                self._chords = ()
                return
            course_rad = last_rad + bend
        now = _Chord(time_s, course_rad, gyro_rad)
        since_s = time_s - _LONGEST_TURN_S
        self._chords = (*(one for one in self._chords if one.time_s >= since_s), now)
        first = self._chords[0]
        by_course = course_rad - first.course_rad
        by_gyro = [
            one.gyro_rad - first.gyro_rad
            for one in self._chords
            if one.time_s >= time_s - _LATEST_S
        ]
        if max(abs(by_course), min(map(abs, by_gyro))) < _LEAST_TURN_RAD:
            return
        if all(abs(by_course - by) > _ASTRAY * max(abs(by_course), abs(by)) for by in by_gyro):
            if not contradicted:
                # A receiver that jumps turns one chord, a car all that follow.
                self._contradicted = True
                return
            self._against = min(self._against + 1, _TURNS)
        else:
            self._against = max(self._against - 1, 0)
        self._chords = (now,)
        self.believed = self._against < (_TURNS if self.believed else 1)
