"""What a vehicle has measured lately: the latest samples, their age, and which were refused."""

from __future__ import annotations

import functools
import math
import sys
from collections import Counter
from typing import Any, NamedTuple

import msgspec

from foretwin.contracts.drive import SpeedSample, SteeringSample
from foretwin.geometry.steering import SteeringColumn
from foretwin.telemetry.estimator.shallow_copy import shallow_copy

FRESH_NS = 1_000_000_000
"""A quantity counts as measured while its last sample is younger than this."""
CLOCK_LEAP_NS = 10_000_000_000
"""One stamp that is this far ahead must not make all later ones look late."""
MOTION_FIELDS = ("yaw_rad", "speed_mps", "yaw_rate_radps", "accel_mps2", "tire_angle_rad")
"""Fields of VehicleState that are either measured or estimated."""
_TURNING = ("yaw_rate_radps", "tire_angle_rad")
_CHANNEL_FIELDS = {
    "imu": ("yaw_rate_radps", "accel_mps2"),
    "speed": ("speed_mps",),
    "heading": ("yaw_rad",),
    "steering": ("tire_angle_rad",),
}
MOST_SPEED_MPS = 100.0
_LIMITS = {
    "speed_mps": MOST_SPEED_MPS,
    "accel_mps2": 100.0,
    "rate_radps": 20.0,
    "yaw_rad": 100.0,
    "yaw_rate_radps": 20.0,
    "tire_angle_rad": 1.5,
    "steering_wheel_rad": 50.0,
}
"""Beyond these a number is no motion of a road vehicle."""


class Steering(NamedTuple):
    """By what a car's path bends as its steering turns."""

    wheelbase_m: float
    column: SteeringColumn


USUAL_STEERING = Steering(wheelbase_m=2.7, column=SteeringColumn(ratio=15.0, offset_rad=0.0))
"""An ordinary car's, for one of which nothing else is known."""


class MotionSamples:
    """Remembers samples beside positions; `skipped` counts what it refused, by reason."""

    def __init__(self, steering: Steering = USUAL_STEERING, *, skipped: Counter[str]) -> None:
        self.wheelbase_m = steering.wheelbase_m
        self._column = steering.column
        self._skipped = skipped
        self._sample_ns: dict[str, int] = {}
        self._field_ns: dict[str, int] = {}
        self._leap_ns: dict[str, int] = {}
        self._steering: SteeringSample | None = None
        self.speed_mps = 0.0
        """The last measured speed; 0 before there is one."""

    def copy(self, *, skipped: Counter[str]) -> MotionSamples:
        """Return another memory of the same samples that counts into `skipped`."""
        other = shallow_copy(self)
        other._skipped = skipped
        other._sample_ns, other._field_ns = self._sample_ns.copy(), self._field_ns.copy()
        return other

    def take(self, channel: str, message: Any) -> bool:
        """Remember a sample; return False for one that is refused or says nothing of the motion."""
        fields = _CHANNEL_FIELDS.get(channel)
        if fields is None:
            return False
        stamp_ns = message.stamp_ns
        if stamp_ns < self._sample_ns.get(channel, stamp_ns):
            self._skipped[f"{channel}_time_backwards"] += 1
            return False
        if self._leaps(channel, stamp_ns):
            self._skipped[f"{channel}_time_leap"] += 1
            return False
        fault = _fault(message)
        if fault is not None:
            self._skipped[f"{channel}_{fault}"] += 1
            return False
        self._sample_ns[channel] = stamp_ns
        for name in fields:
            if name != "accel_mps2" or message.tells_force:
                self._field_ns[name] = stamp_ns
        if getattr(message, "yaw_rate_radps", None) is not None:
            self._field_ns["yaw_rate_radps"] = stamp_ns
        if isinstance(message, SpeedSample):
            self.speed_mps = message.speed_mps
        elif isinstance(message, SteeringSample):
            self._steering = message
        return True

    def disbelieve(self, name: str, reason: str) -> None:
        """Count by `reason` a sample by which field `name` is not measured after all."""
        self._skipped[reason] += 1
        self._field_ns.pop(name, None)

    def _leaps(self, channel: str, stamp_ns: int) -> bool:
        """Return whether the stamp is far ahead without a second one to bear witness."""
        if stamp_ns - self._sample_ns.get(channel, stamp_ns) <= CLOCK_LEAP_NS:
            return False
        before_ns = self._leap_ns.get(channel)
        self._leap_ns = {**self._leap_ns, channel: stamp_ns}
        return before_ns is None or not 0 <= stamp_ns - before_ns <= CLOCK_LEAP_NS

    @property
    def anything(self) -> bool:
        """Whether any sample beside positions has come."""
        return bool(self._sample_ns)

    def fresh(self, name: str, stamp_ns: int) -> bool:
        """Return whether field `name` was measured within a second before `stamp_ns`."""
        measured_ns = self._field_ns.get(name)
        return measured_ns is not None and stamp_ns - measured_ns <= FRESH_NS

    def tells_turning(self, stamp_ns: int) -> bool:
        """Return whether anything beside positions told how the car turns: no heading does, which
        says where it points now and then."""
        return any(self.fresh(name, stamp_ns) for name in _TURNING)

    def estimated(self, stamp_ns: int) -> tuple[str, ...]:
        """Return the names of the motion fields that are not fresh."""
        return tuple(name for name in MOTION_FIELDS if not self.fresh(name, stamp_ns))

    @property
    def steering_wheel_rad(self) -> float | None:
        """The last measured angle at the steering wheel."""
        return None if self._steering is None else self._steering.steering_wheel_rad

    @property
    def tire_angle_rad(self) -> float | None:
        """The last measured angle at the tyres, or what the steering wheel's implies."""
        if self._steering is None:
            return None
        if self._steering.tire_angle_rad is not None:
            return self._steering.tire_angle_rad
        wheel = self._steering.steering_wheel_rad
        return None if wheel is None else self._column.tire_rad(wheel)

    @property
    def curvature_pm(self) -> float | None:
        """The path's curvature that the tyres' angle implies, None without one."""
        angle = self.tire_angle_rad
        return None if angle is None else math.tan(angle) / self.wheelbase_m


class Doubt:
    """What standard deviation to give a sensor that states none: its recent surprises, bounded.

    Speeds and courses of a satellite receiver lag behind its positions by up to a second; taken at
    their word they would lead the track away. What the filter itself did not know counts for
    nothing (Mehra 1970, eq. 18): it would teach itself to distrust who could correct it.
    """

    def __init__(self, least: float, most: float = math.inf) -> None:
        self._least, self._most = least, most
        self._mean_square = 0.0

    def std(self, surprise: float, own_variance: float = 0.0) -> float:
        """Take the latest surprise, which the filter expected to have `own_variance` without any
        noise, and return the standard deviation to use for it."""
        square = surprise * surprise - own_variance
        self._mean_square = max(0.0, self._mean_square + 0.02 * (square - self._mean_square))
        return min(max(self._least, 2.0 * math.sqrt(self._mean_square)), self._most)


def _fault(message: Any) -> str | None:
    """Return why a sample cannot be a road vehicle's, or None."""
    kind_of_message: type[msgspec.Struct] = type(message)
    for name, most in _bounds(kind_of_message):
        value = getattr(message, name)
        kind = type(value)
        if kind is not float and kind is not tuple:
            continue
        for number in value if kind is tuple else (value,):
            if type(number) is float and not -most <= number <= most:
                return "implausible" if math.isfinite(number) else "not_finite"
    return None


@functools.cache
def _bounds(kind: type[msgspec.Struct]) -> tuple[tuple[str, float], ...]:
    """Return each field of a message with the most that it can be."""
    return tuple((name, _LIMITS.get(name, sys.float_info.max)) for name in kind.__struct_fields__)
