"""The gap between the real vehicle and its model, and which of the two is wrong."""

from __future__ import annotations

from typing import Literal

import msgspec

Manoeuvre = Literal["standstill", "straight", "curve", "braking", "accelerating"]
Culprit = Literal["vehicle", "model", "both", "none", "undecided"]
LimitedQuantity = Literal["along_m", "across_m", "yaw_rad", "speed_mps"]
ALARM_LIMITS_PER_S: dict[LimitedQuantity, float] = {
    "along_m": 0.8,
    "across_m": 0.5,
    "yaw_rad": 0.07,
    "speed_mps": 0.6,
}
"""What may be lost for each second that the model was left to itself, by quantity of GapSample."""
ALARM_HORIZON_S = 2.0
"""Alarms are about the gap after so long; before, as much may be lost as then."""
_GROWS: dict[LimitedQuantity, int] = {"along_m": 2, "across_m": 2, "yaw_rad": 1, "speed_mps": 1}
"""The power of time with which a gap grows that a steady departure makes: a push that is off adds
up to speed and that to metres, a bend that is off to heading and that to metres."""
STATE_STDS = 2.0
"""So many standard deviations of what uncertain states make of a gap widen its limits."""


class GapSample(msgspec.Struct, frozen=True, kw_only=True):
    """Model minus reality after the model ran freely for `horizon_s` from the measured state.

    Along and across the real heading (positive: ahead, left); `independent` is false where the
    model was driven by commands estimated from the very motion it is compared with.
    """

    vehicle_id: str
    stamp_ns: int
    horizon_s: float
    manoeuvre: Manoeuvre
    along_m: float
    across_m: float
    yaw_rad: float
    yaw_rate_radps: float
    speed_mps: float
    accel_mps2: float
    independent: bool
    along_std_m: float = 0.0
    """What uncertain states leave open of it, as standard deviations; 0 where they state none."""
    across_std_m: float = 0.0
    yaw_std_rad: float = 0.0
    speed_std_mps: float = 0.0

    @property
    def limits(self) -> dict[LimitedQuantity, float]:
        """Return beyond which gaps it is an alarm, by quantity."""
        open_by_states: dict[LimitedQuantity, float] = {
            "along_m": self.along_std_m,
            "across_m": self.across_std_m,
            "yaw_rad": self.yaw_std_rad,
            "speed_mps": self.speed_std_mps,
        }
        return {
            name: limit + STATE_STDS * open_by_states[name]
            for name, limit in limits_after(self.horizon_s).items()
        }

    @property
    def beyond_limits(self) -> bool:
        """Whether one of them is exceeded."""
        return any(abs(getattr(self, name)) > limit for name, limit in self.limits.items())


def limits_after(seconds: float) -> dict[LimitedQuantity, float]:
    """Return what may be lost, by quantity, where the model was left to itself for `seconds`.

    The one table of limits: of alarms, of what the viewer draws, and of what summaries count. A
    steady departure that is beyond them at `ALARM_HORIZON_S` is so ever after, and none else.
    """
    times = max(seconds / ALARM_HORIZON_S, 1.0)
    return {
        name: per_s * ALARM_HORIZON_S * times ** _GROWS[name]
        for name, per_s in ALARM_LIMITS_PER_S.items()
    }


class GapAlarm(msgspec.Struct, frozen=True, kw_only=True):
    """A gap beyond its limit, or (`over` false) back within it."""

    vehicle_id: str
    stamp_ns: int
    quantity: str
    value: float
    limit: float
    manoeuvre: Manoeuvre
    over: bool = True


class Evidence(msgspec.Struct, frozen=True, kw_only=True):
    """One comparison behind a verdict: a figure, what it should be, and its uncertainty."""

    name: str
    value: float
    expected: float
    std: float
    text: str


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """Who departs from the commands, since when and how, with the evidence in words and numbers.

    `cause` is a key such as steering_gain, steering_sign, steering_in_degrees, steering_delay,
    saturated_steering, offset_sensor, wheelbase, steering_ratio, friction; "" where none is.
    """

    vehicle_id: str
    stamp_ns: int
    since_stamp_ns: int
    culprit: Culprit
    cause: str
    text: str
    evidence: tuple[Evidence, ...]
    confidence: float
    """0 to 1: how sure the culprit is."""
