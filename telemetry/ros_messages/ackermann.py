"""What an AckermannDrive asks for: a speed, and how hard it may be changed on the way there.

AckermannDrive.msg: "Zero acceleration means change speed as quickly as possible. Positive
acceleration indicates a desired absolute magnitude; that includes deceleration." Whether a car is
told to pull away or to brake is therefore known by its own speed alone.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from foretwin.contracts import drive

NO_ACCELERATION = "no acceleration commanded"
_SPEED_WITHIN_NS = 500_000_000
"""A measured speed older than this is none of the command's instant."""
_HELD_WITHIN_MPS = 0.1
"""A command so near to the measured speed holds it: wheels tell theirs no better."""
HARDLY_MPS2 = 0.01
"""Stands for a commanded 0 in a message in which 0 means as hard as possible."""


class AckermannTarget(msgspec.Struct, frozen=True, kw_only=True):
    """What one message asks for, before it is known whether that is braking."""

    stamp_ns: int
    speed_mps: float
    """To be reached; negative in reverse."""
    limit_mps2: float
    """How hard, whichever way; 0: as hard as possible. Below 0, which the type does not know, those
    who send it mean braking."""
    tire_angle_rad: float


def target_from_ros(ros: Any, stamp_ns: int) -> AckermannTarget:
    """Return what an AckermannDriveStamped asks for."""
    asked = ros.drive
    return AckermannTarget(
        stamp_ns=stamp_ns,
        speed_mps=float(asked.speed),
        limit_mps2=float(asked.acceleration),
        tire_angle_rad=float(asked.steering_angle),
    )


def towards(accel_mps2: float, speed_mps: float) -> tuple[float, float]:
    """Return the speed to reach and the magnitude (m/s, m/s²) that ask a car for an acceleration.

    The car drives forwards, and `speed_mps` is what the command wants of it. Braking aims at a
    standstill, so that it never becomes pulling away; nothing is made faster than `speed_mps`.
    """
    return 0.0 if accel_mps2 < 0.0 else speed_mps, max(abs(accel_mps2), HARDLY_MPS2)


class AckermannCommands:
    """Follows the measured and the commanded speed, which say what a target is: taken in turn."""

    def __init__(self) -> None:
        self._measured: drive.SpeedSample | None = None
        self._asked: AckermannTarget | None = None

    def note(self, measured: drive.SpeedSample) -> None:
        """Take in how fast the car is."""
        self._measured = measured

    def command(self, asked: AckermannTarget) -> drive.ControlCommand | None:
        """Return the command that a target is, None where its acceleration cannot be known.

        Its direction is that from the measured speed to the one to be reached; without a measured
        speed of its instant, that in which the speed to be reached has changed.
        """
        before, self._asked = self._asked, asked
        accel_mps2 = self._signed_mps2(asked, before)
        if accel_mps2 is None:
            return None
        return drive.ControlCommand(
            stamp_ns=asked.stamp_ns, accel_mps2=accel_mps2, tire_angle_rad=asked.tire_angle_rad
        )

    def _signed_mps2(self, asked: AckermannTarget, before: AckermannTarget | None) -> float | None:
        if asked.limit_mps2 < 0.0:
            return asked.limit_mps2
        measured = self._measured
        if measured is not None and abs(asked.stamp_ns - measured.stamp_ns) <= _SPEED_WITHIN_NS:
            change_mps = asked.speed_mps - measured.speed_mps
            if abs(change_mps) <= _HELD_WITHIN_MPS:
                return 0.0
        elif before is not None:
            change_mps = asked.speed_mps - before.speed_mps
        else:
            return None
        if asked.limit_mps2 == 0.0 or change_mps == 0.0 or math.isnan(change_mps):
            return None
        return math.copysign(asked.limit_mps2, change_mps)
