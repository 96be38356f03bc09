"""The gap between the real vehicle and its model, and which of the two is wrong."""

from __future__ import annotations

from typing import Literal

import msgspec

Manoeuvre = Literal["standstill", "straight", "curve", "braking", "accelerating"]
Culprit = Literal["vehicle", "model", "both", "none", "undecided"]
ALARM_LIMITS_PER_S = {
    "along_m": 0.8,
    "across_m": 0.5,
    "yaw_rad": 0.07,
    "speed_mps": 0.6,
}
"""What may be lost for each second that the model was left to itself, by quantity of GapSample."""
ALARM_HORIZON_S = 2.0
"""Alarms are about the gap after so long."""


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
