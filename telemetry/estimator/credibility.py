"""Whether a sensor beside positions tells what the car does: turning, way, heading and pushing.

The filter cannot tell: a gyro that is upside down or wheels in km/h lead it along, so that they
surprise nobody. The courses of fixes know nothing of them, but are rough and may come late, so that
whole turns and tens of metres are compared.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.telemetry.estimator.chords import Chord
from foretwin.telemetry.estimator.facing import FASTEST_REVERSE_MPS

LATE_S = (0.0, 1.0, 2.0, 3.0)
"""So late may courses be: in Dresden one receiver's are by 2 s."""
_TIMES = 3
"""So many more times must a sensor be contradicted than borne out before it is left out; of one
that nothing has borne out yet the first will do. Chosen."""
_LEAST_TURN_RAD, _LONGEST_TURN_S = 1.0, 10.0
_ASTRAY = 0.75
"""Of the larger of two turns: courses of an antenna far ahead part less from a true gyro; one that
is stuck, upside down or in degrees parts by all of it. Chosen."""
_LARGEST_BEND_RAD = 1.5
"""Between chords one after the other: more is a fix that jumped, or a car that backs."""
_SWING_RAD = 0.5
"""Chords that bend by more one way and at once the other are a rough receiver's. Chosen: five times
what a chord's course is good to."""
_LEAST_WAY_M, _LEAST_CHORDS, _LARGEST_SHARE = 30.0, 3, 0.6
"""A way is no single jump of the receiver's. Chosen."""
_MOST_TIMES = 1.9
"""Knots are 1.94 times metres per second, miles per hour 2.2. Fixes that a receiver smooths on
setting out make 1.8 (Dresden, 14 February), slip and tight turns less."""
_OFF_RAD = math.radians(45.0)
"""An antenna far ahead of the axle goes so far beside the heading in no but the tightest turn."""
_LEAST_SWING_MPS, _SWING_DEVIATIONS, _LEAST_SPEEDS, _LONGEST_SWING_S = 1.5, 6.0, 6, 12.0
"""So much, and so many times what they are good to, must speeds vary about a steady change, in a
root mean square: that may be a bias or a grade. Over a longer time grades change, too. Chosen."""
_FORCE_ASTRAY = 0.5
"""Of the larger of two swings, where wheels tell of speeds: half or twice as much, or late by a
second. What fixes show of them is rougher than it seems: _ASTRAY. Chosen."""


class Credibility:
    """Counts what contradicts a sensor, and what bears it out."""

    def __init__(self) -> None:
        self.holds = True
        self._against = _TIMES - 1

    def weigh(self, fits: list[bool]) -> None:
        """Take whether the sensor fits by each lateness; one that fits if late alone says nothing.

        What was lost comes back once as much has borne it out.
        """
        if not fits[0] and any(fits):
            return
        contradicted = not fits[0]
        self._against += 1 if contradicted else -1
        self._against = min(max(self._against, 0), _TIMES)
        self.holds = self._against < (_TIMES if self.holds else 1)


class _CourseTold(NamedTuple):
    """A chord's course, summed without wrapping, and a sensor's angle by each lateness."""

    time_s: float
    course_rad: float
    angles_rad: tuple[float, ...]


class TurningCredibility(Credibility):
    """Of a sensor that tells how the car turns."""

    def __init__(self) -> None:
        super().__init__()
        self._latest: tuple[_CourseTold, ...] = ()
        """Of the last two chords."""
        self._courses: tuple[_CourseTold, ...] = ()
        self._to_s = -math.inf
        self._bend_rad = 0.0

    def take(self, chord: Chord, angles_rad: tuple[float, ...] | None) -> None:
        """Compare a chord with the angle told in its middle, by each lateness; None if unknown."""
        if angles_rad is None or chord.from_s != self._to_s:
            # In between nobody knows which way round it turned, nor whether it backed.
            self._latest, self._courses, self._bend_rad = (), (), 0.0
        self._to_s = chord.to_s
        if angles_rad is None:
            return
        course_rad = chord.course_rad
        if self._latest:
            last_rad = self._latest[-1].course_rad
            bend = math.remainder(course_rad - last_rad, math.tau)
            before, self._bend_rad = self._bend_rad, bend
            swings = bend * before < 0.0 and min(abs(bend), abs(before)) > _SWING_RAD
            if swings or abs(bend) > _LARGEST_BEND_RAD:
                self._latest = self._courses = ()
                return
            course_rad = last_rad + bend
        latest = (*self._latest, _CourseTold(chord.middle_s, course_rad, angles_rad))
        self._latest = latest[-2:]
        if len(latest) == 3:
            # A receiver that jumps turns one chord, a car all that follow.
            self._compare(
                latest[1]._replace(course_rad=sorted(one.course_rad for one in latest)[1])
            )

    def _compare(self, now: _CourseTold) -> None:
        since_s = now.time_s - _LONGEST_TURN_S
        self._courses = (*(one for one in self._courses if one.time_s >= since_s), now)
        most = max(self._courses, key=lambda one: abs(now.course_rad - one.course_rad))
        by_course, told = _turn(most, now)
        if abs(by_course) < _LEAST_TURN_RAD:
            by_course, told = _turn(self._courses[0], now)
            if min(map(abs, told)) < _LEAST_TURN_RAD:
                return
        fits = [abs(by_course - by) <= _ASTRAY * max(abs(by_course), abs(by)) for by in told]
        if fits[0] or not any(fits):  # else let it turn on
            self._courses = (now,)
            self.weigh(fits)


def _turn(first: _CourseTold, last: _CourseTold) -> tuple[float, list[float]]:
    """Return by how much the course turned, and the sensor's angle by each lateness."""
    told = [b - a for a, b in zip(first.angles_rad, last.angles_rad, strict=False)]
    return last.course_rad - first.course_rad, told


class WayCredibility(Credibility):
    """Of wheels."""

    def __init__(self) -> None:
        super().__init__()
        self._chords: tuple[Chord, ...] = ()
        self._ways_m: tuple[float, ...] = ()

    def take(self, chord: Chord, ways_m: tuple[float, ...] | None) -> None:
        """Compare a chord with the wheels' way along it, by each lateness; None if unknown."""
        if ways_m is None or (self._chords and chord.from_s != self._chords[-1].to_s):
            self._chords = ()
        if ways_m is None:
            return
        before = self._ways_m if self._chords else (0.0,) * len(ways_m)
        self._ways_m = tuple(a + b for a, b in zip(before, ways_m, strict=False))
        self._chords = (*self._chords, chord)
        lengths = [one.length_m for one in self._chords]
        length_m, lasts_s = sum(lengths), chord.to_s - self._chords[0].from_s
        if len(lengths) < _LEAST_CHORDS or length_m < _LEAST_WAY_M:
            return
        self._chords = ()
        if max(lengths) > _LARGEST_SHARE * length_m:
            return
        fast = length_m > FASTEST_REVERSE_MPS * lasts_s
        times = [(way if fast else abs(way)) / length_m for way in self._ways_m]
        self.weigh([1.0 / _MOST_TIMES < one < _MOST_TIMES for one in times])


class HeadingCredibility(Credibility):
    """Of a sensor that tells where the car points."""

    def __init__(self) -> None:
        super().__init__()
        self._fits = True
        self._lengths_m: tuple[float, ...] = ()

    def take(self, chord: Chord, yaws_rad: tuple[float, ...] | None, *, backs: bool) -> None:
        """Compare a chord with the heading in its middle, by each lateness; None if unknown.

        `backs` where wheels say that the car goes backwards.
        """
        if yaws_rad is None:
            self._lengths_m = ()
            return
        course = chord.course_rad + (math.pi if backs else 0.0)
        fits = [abs(math.remainder(yaw - course, math.tau)) < _OFF_RAD for yaw in yaws_rad]
        if any(fits) != self._fits:
            self._lengths_m = ()
        self._fits, self._lengths_m = any(fits), (*self._lengths_m, chord.length_m)
        if len(self._lengths_m) < _LEAST_CHORDS or sum(self._lengths_m) < _LEAST_WAY_M:
            return
        self._lengths_m = ()
        self.weigh(fits)


class _SpeedTold(NamedTuple):
    """A speed, and the sum of what a sensor felt until then by each lateness (m/s)."""

    time_s: float
    speed_mps: float
    std_mps: float
    felt_mps: tuple[float, ...]


class ForceCredibility(Credibility):
    """Of a sensor that tells how hard the car is pushed ahead or held back."""

    def __init__(self) -> None:
        super().__init__()
        self._speeds: tuple[_SpeedTold, ...] = ()

    def take(
        self, time_s: float, speed_mps: float, felt_mps: tuple[float, ...] | None, *, std_mps: float
    ) -> None:
        """Compare a speed good to `std_mps`, negative in reverse, with the sum felt until then by
        each lateness, None if unknown; it says something once all of them are known."""
        if felt_mps is None or len(felt_mps) < len(LATE_S):
            self._speeds = ()  # what was felt in between is not known
            return
        since_s = time_s - _LONGEST_SWING_S
        kept = (one for one in self._speeds if one.time_s >= since_s)
        self._speeds = (*kept, _SpeedTold(time_s, speed_mps, std_mps, felt_mps))
        if len(self._speeds) >= _LEAST_SPEEDS:
            self._compare()

    def _compare(self) -> None:
        times_s = np.array([one.time_s for one in self._speeds])
        speeds_mps = np.array([one.speed_mps for one in self._speeds])
        swing, swing_mps = _about_a_steady_change(times_s, speeds_mps)
        std_mps = max(one.std_mps for one in self._speeds)
        if swing_mps < max(_LEAST_SWING_MPS, _SWING_DEVIATIONS * std_mps):
            return
        most = _ASTRAY if std_mps > 0.0 else _FORCE_ASTRAY
        fits = []
        for sums_mps in zip(*(one.felt_mps for one in self._speeds), strict=True):
            felt, felt_mps = _about_a_steady_change(times_s, np.array(sums_mps))
            off_mps = math.sqrt(float(np.mean((swing - felt) ** 2)))
            fits.append(off_mps <= most * max(swing_mps, felt_mps))
        if fits[0] or not any(fits):
            self._speeds = self._speeds[-1:]
            self.weigh(fits)


def _about_a_steady_change(times_s: Array, values: Array) -> tuple[Array, float]:
    """Return how values (N,) differ from a straight line through them, and its mean root square."""
    since_s = times_s - times_s.mean()
    off = values - values.mean()
    off = off - since_s * float(since_s @ off) / float(since_s @ since_s)
    return off, math.sqrt(float(np.mean(off * off)))
