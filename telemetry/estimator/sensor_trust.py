"""Holds what a car's sensors say against where its positions go, and says which to leave out."""

from __future__ import annotations

import math
from typing import Any

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import HeadingSample, ImuSample, SpeedSample, SteeringSample
from foretwin.telemetry.estimator.chords import LONGEST_S, Chord, ChordBegun, Trail
from foretwin.telemetry.estimator.credibility import (
    LATE_S,
    ForceCredibility,
    HeadingCredibility,
    TurningCredibility,
    WayCredibility,
)
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

LEFT_OUT = {
    "imu": ("yaw_rate_radps", "imu_turns_otherwise"),
    "steering": ("tire_angle_rad", "steering_turns_otherwise"),
    "speed": ("speed_mps", "speed_goes_otherwise"),
    "heading": ("yaw_rad", "heading_points_otherwise"),
    "forces": ("accel_mps2", "imu_pushes_otherwise"),
}
"""By channel: the field that is not believed, and as what its samples are counted. The forces of an
inertial unit stand apart from its turning."""
_SPEED_EVERY_S = 0.5
"""Forces are held against measured speeds so seldom. Chosen."""
_PARTS = 4
"""A chord's speed is a mean: in so many parts of it one asks what was felt."""


class SensorTrust:
    """Takes samples and believed fixes in the order of their stamps."""

    def __init__(self) -> None:
        self._begun: ChordBegun | None = None
        self._turned, self._driven, self._pointed, self._bent = Trail(), Trail(), Trail(), Trail()
        self._pushed, self._felt_s = Trail(), -math.inf
        self._gyro, self._steering = TurningCredibility(), TurningCredibility()
        self._wheels, self._headings = WayCredibility(), HeadingCredibility()
        self._forces = ForceCredibility()
        self._steered_rad = 0.0
        self.left_out: frozenset[str] = frozenset()
        """What does not go with positions, as far as these tell: keys of LEFT_OUT."""

    def copy(self) -> SensorTrust:
        """Return another one that goes on from here by itself: what is in it is never changed."""
        return shallow_copy(self)

    def take(self, message: Any, *, gyro_bias_radps: float, curvature_pm: float | None) -> None:
        """Take a sample; `curvature_pm` is what the latest measured steering implies."""
        time_s = message.stamp_ns * 1e-9
        match message:
            case ImuSample(rate_radps=rate, accel_mps2=accel):
                self._turned = self._turned.gone_on(time_s, rate[2] - gyro_bias_radps)
                if message.tells_force:
                    self._pushed = self._pushed.gone_on(time_s, accel[0])
            case SpeedSample(speed_mps=speed):
                if self._wheels.holds and time_s - self._felt_s >= _SPEED_EVERY_S:
                    self._felt(time_s, speed, _around(self._pushed, time_s))
                self._driven = self._driven.gone_on(time_s, speed)
            case HeadingSample(yaw_rad=yaw):
                self._pointed = self._pointed.turned_to(time_s, yaw)
            case SteeringSample() if curvature_pm is not None:
                self._bent = self._bent.gone_on(time_s, curvature_pm)

    def take_fix(self, stamp_ns: int, xy_m: Array, std_m: float, *, convergence_rad: float) -> None:
        """Take a believed fix at `xy_m` (2,) with white noise of `std_m`.

        `convergence_rad` is the angle of the fixes' frame against east.
        """
        begun, now = self._begun, ChordBegun(stamp_ns * 1e-9, xy_m)
        chord = None if begun is None else begun.to(now.time_s, xy_m, std_m)
        if begun is None or chord is not None or now.time_s - begun.time_s > LONGEST_S:
            self._begun = now
        if chord is None:
            return
        self._gyro, self._steering = shallow_copy(self._gyro), shallow_copy(self._steering)
        self._wheels, self._headings = shallow_copy(self._wheels), shallow_copy(self._headings)
        ways_m = _between(self._driven, chord)
        self._gyro.take(chord, _around(self._turned, chord.middle_s))
        self._wheels.take(chord, ways_m)
        backs = self._wheels.holds and ways_m is not None and ways_m[0] < 0.0
        self._steering.take(chord, self._steered(chord, backs=backs))
        yaws_rad = _around(self._pointed, chord.middle_s)
        if yaws_rad is not None:
            yaws_rad = tuple(yaw + convergence_rad for yaw in yaws_rad)
        self._headings.take(chord, yaws_rad, backs=backs)
        if not self._wheels.holds and "speed" not in self.left_out:
            self._forces = ForceCredibility()  # they were held against these
        if ways_m is None or not self._wheels.holds:
            lasts_s = chord.to_s - chord.from_s
            speed_std_mps = math.sqrt(2.0) * std_m / lasts_s
            felt_mps = _within(self._pushed, chord)
            self._felt(chord.middle_s, chord.length_m / lasts_s, felt_mps, std_mps=speed_std_mps)
        sensors = (self._gyro, self._steering, self._wheels, self._headings, self._forces)
        held = zip(LEFT_OUT, sensors, strict=True)
        self.left_out = frozenset(channel for channel, one in held if not one.holds)

    def _felt(
        self,
        time_s: float,
        speed_mps: float,
        felt_mps: tuple[float, ...] | None,
        *,
        std_mps: float = 0.0,
    ) -> None:
        """Hold a speed, good to `std_mps`, against what was felt until then."""
        self._felt_s = time_s
        self._forces = shallow_copy(self._forces)
        self._forces.take(time_s, speed_mps, felt_mps, std_mps=std_mps)

    def _steered(self, chord: Chord, *, backs: bool) -> tuple[float, ...] | None:
        """Return the angle that the steering gives along all chords up to this one's middle."""
        bends = _between(self._bent, chord)
        if bends is None:
            return None
        way_m = -chord.length_m if backs else chord.length_m
        half_rad = 0.5 * bends[0] / (chord.to_s - chord.from_s) * way_m
        self._steered_rad += 2.0 * half_rad
        return (self._steered_rad - half_rad,)


def _around(trail: Trail, time_s: float) -> tuple[float, ...] | None:
    """Return a trail's values at `time_s` and before, by how late it may be; None if unknown."""
    known = [trail.at(time_s - late_s) for late_s in LATE_S]
    found = tuple(value for value in known if value is not None)
    return None if known[0] is None else found


def _within(trail: Trail, chord: Chord) -> tuple[float, ...] | None:
    """Return a trail's mean value along a chord, by each lateness; None if unknown."""
    parts = [chord.from_s + (k + 0.5) / _PARTS * (chord.to_s - chord.from_s) for k in range(_PARTS)]
    known = [_around(trail, time_s) for time_s in parts]
    if None in known:
        return None
    return tuple(sum(values) / _PARTS for values in zip(*filter(None, known), strict=False))


def _between(trail: Trail, chord: Chord) -> tuple[float, ...] | None:
    """Return by how much a trail went on along a chord, by each lateness; None if unknown."""
    ends, begins = _around(trail, chord.to_s), _around(trail, chord.from_s)
    if ends is None or begins is None:
        return None
    return tuple(end - begin for begin, end in zip(begins, ends, strict=False))
