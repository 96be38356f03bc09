"""The signals that steering is identified from, and what given parameters leave unexplained.

A single-track car turns with r = v/L (tan(δ - β) + β), where β is its rear tyres' slip and

    δ = (w - τ dw/dt)/i + δ0 + p⁺ a⁺ + p⁻ a⁻ - K a_y - T dr/dt

with steering wheel w, ratio i, offset δ0 at the tyre, understeer gradient K (Gillespie 1992, eq.
6-15), T = I_z/L (1/C_f + 1/C_r) for what the tyres need to turn the body, τ by which the tyres (or
the gyro's samples) come after the steering wheel, and p± by which the car pulls to a side when it
is driven or braked.

Sideways acceleration is v r only as long as the car does not begin or end to slide sideways: on the
way into a bend it differs by a tenth. Slips follow from the forces that the axles must bear, and
those from the acceleration, so that two rounds are enough (Gillespie 1992, chapter 6).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.identify.regression import smoothed_and_rate
from foretwin.sim_worker.analysis.motion_record import MotionRecord

WIDTH_S = 0.1
ALIKE_S = 2.0 * math.sqrt(math.pi) * WIDTH_S
"""For so long, smoothed white noise says one thing only."""
SLOWEST_MPS = 2.0
"""Below it, slips are lost in noise."""
_LEAST_STOOD = 4.0
_MAX_LATERAL_MPS2 = 4.0
"""Beyond it, tyres are no longer linear."""
_MAX_TIRE_RAD = 0.25
"""Beyond it, an axle's two wheels are not one: steered alike, by 0.25 they turn a car as one would
by 1.5 % less, by 0.58 by 8 %; how nearly each points across the way to the bend's middle no file
says, nor what the two that scrub take of the car's speed."""
_ALIKE_PER_RAD2 = 0.24
"""So much less of its angle do wheels that are steered alike turn a car by, times its square."""
_LEAST_FEED = 0.2
"""Of 1 + K v²/L, which is zero at the speed where an oversteering car loses its stability."""
_ANGLES_BELOW_MPS = 4.0
"""A planar car leaves so much of the tyre angle unexplained, and sensors so much of the yaw rate,
that an instant tells the angle best from this speed on, and no better when faster."""
_ROLLING_MPS2 = 1.0
"""Tyres that drive or brake by much more turn a car otherwise than those that roll."""


class Theta(IntEnum):
    """The parameters θ: 1/i, δ0, K, T, the gyro's bias, τ/i, p⁺, p⁻."""

    INVERSE_RATIO, OFFSET, UNDERSTEER, TURNING, GYRO_BIAS, LAG, PULL_DRIVEN, PULL_BRAKED = range(8)


class Unexplained(NamedTuple):
    """Yaw rate (M,) that parameters leave unexplained, and its slopes (8, M) by each of them."""

    yaw_rate_radps: Array
    slopes: Array


class SteeringSignals(NamedTuple):
    """Smoothed signals at N instants, of which those `used` (M) count, while driving."""

    time_s: Array
    used: Indices
    speed_mps: Array
    yaw_rate_radps: Array
    wheel_rad: Array
    wheel_radps: Array
    rear_slip_rad: Array
    lateral_mps2: Array
    given: Array
    """What each parameter is multiplied by at the tyre (8, N)."""
    per_m: Array
    """Speed over wheelbase (M,)."""
    wheelbase_m: float
    gyro_bias_radps: float
    gyro_bias_std_radps: float
    """What the gyro told while the car stood, and how surely; 0 and inf where it did not."""

    def unexplained(self, values: Array) -> Unexplained:
        """Return what parameters (8,) leave unexplained of the yaw rate."""
        used, per_m = self.used, self.per_m
        asked, slip, speed = self.given[:, used], self.rear_slip_rad[used], self.speed_mps[used]
        front = np.clip(values @ asked - slip, -1.2, 1.2)
        slope = per_m * (1.0 + np.square(np.tan(front)))
        # Measured yaw rate stands on both sides: solved for, its noise no longer weighs K.
        feeds = np.maximum(1.0 + slope * values[Theta.UNDERSTEER] * speed, _LEAST_FEED)
        apart = self.yaw_rate_radps[used] - per_m * (np.tan(front) + slip) - values[Theta.GYRO_BIAS]
        apart /= feeds
        slopes = asked * slope
        slopes[Theta.UNDERSTEER] += slope * speed * apart
        slopes[Theta.GYRO_BIAS] = 1.0
        return Unexplained(apart, slopes / feeds)

    def gaining_mps2(self) -> Array:
        """Return by how much the car speeds up (M,)."""
        pulls = self.given[Theta.PULL_DRIVEN] + self.given[Theta.PULL_BRAKED]
        return np.asarray(pulls[self.used])

    def weights(self) -> Array:
        """Return how much an instant's yaw rate (M,) counts, against one that rolls slowly."""
        slow = 1.0 / np.hypot(1.0, self.speed_mps[self.used] / _ANGLES_BELOW_MPS)
        return np.asarray(slow / np.hypot(1.0, self.gaining_mps2() / _ROLLING_MPS2))

    def steered_rad(self, values: Array) -> Array:
        """Return the tyre angle (N,) that the motion asks the steering wheel for."""
        turned = self.wheelbase_m * (self.yaw_rate_radps - values[Theta.GYRO_BIAS])
        turned /= np.maximum(self.speed_mps, SLOWEST_MPS)
        tyre = np.arctan(turned - self.rear_slip_rad) + self.rear_slip_rad
        by_wheel = (
            values[Theta.INVERSE_RATIO] * self.wheel_rad - values[Theta.LAG] * self.wheel_radps
        )
        return np.asarray(tyre - (values @ self.given - by_wheel))

    def less_if_alike(self, values: Array) -> Array:
        """Return how much less of the yaw rate (M,) parameters explain if both wheels are steered
        alike, and not each across the way to the bend's middle."""
        wheel_rad = self.late_wheel_rad(values)[self.used]
        tyre_rad = values[Theta.INVERSE_RATIO] * wheel_rad + values[Theta.OFFSET]
        slopes = self.unexplained(values).slopes[Theta.OFFSET]
        return np.asarray(_ALIKE_PER_RAD2 * tyre_rad**3 * slopes)

    def late_wheel_rad(self, values: Array) -> Array:
        """Return the steering wheel (N,) as the tyres follow it, τ before."""
        return np.asarray(
            self.wheel_rad - values[Theta.LAG] / values[Theta.INVERSE_RATIO] * self.wheel_radps
        )


def _mean(values: Array, *, alike: float) -> tuple[float, float]:
    """Return mean and its std, as wide as Student's of so few that are not `alike`."""
    count = len(values) / alike
    if count < _LEAST_STOOD:
        return 0.0, math.inf
    return float(np.mean(values)), float(np.std(values) / math.sqrt(count - 3.0))


def steering_signals(record: MotionRecord, vehicle: VehicleParameters) -> SteeringSignals:
    """Return the signals of a record at even instants; ValueError saying what it lacks."""
    for name, told in (
        ("wheel_rad", "steering-wheel angle"),
        ("speed_mps", "speed"),
        ("yaw_rate_radps", "yaw rate"),
    ):
        if not record.has(name):
            raise ValueError(f"no {told} was measured for half of the time")
    period_s = float(record.time_s[1])

    (speed, gaining), (rate, turning), (wheel, steering) = (
        smoothed_and_rate(getattr(record, name), period_s=period_s, width_s=WIDTH_S)
        for name in ("speed_mps", "yaw_rate_radps", "wheel_rad")
    )
    side = sideways(vehicle, speed, rate, turning, period_s=period_s)
    base = vehicle.wheelbase_m.value
    known = np.isfinite(wheel) & np.isfinite(side.accel_mps2)
    moving = known & (speed > SLOWEST_MPS) & (np.abs(side.accel_mps2) < _MAX_LATERAL_MPS2)
    moving &= ~turns_sharply(vehicle, speed, rate)
    if not moving.any():
        raise ValueError("the car did not drive")
    used = np.flatnonzero(moving)
    standing = np.isfinite(rate) & (np.abs(speed) < 1e-3)
    given = {
        Theta.INVERSE_RATIO: wheel,
        Theta.OFFSET: np.ones_like(wheel),
        Theta.UNDERSTEER: -side.accel_mps2,
        Theta.TURNING: -turning,
        Theta.GYRO_BIAS: np.zeros_like(wheel),
        Theta.LAG: -steering,
        Theta.PULL_DRIVEN: np.maximum(gaining, 0.0),
        Theta.PULL_BRAKED: np.minimum(gaining, 0.0),
    }
    bias, bias_std = _mean(rate[standing], alike=ALIKE_S / period_s)
    return SteeringSignals(
        time_s=record.time_s,
        used=used,
        speed_mps=speed,
        yaw_rate_radps=rate,
        wheel_rad=wheel,
        wheel_radps=steering,
        rear_slip_rad=side.rear_slip_rad,
        lateral_mps2=side.accel_mps2,
        given=np.stack([given[parameter] for parameter in Theta]),
        per_m=speed[used] / base,
        wheelbase_m=base,
        gyro_bias_radps=bias,
        gyro_bias_std_radps=bias_std,
    )


def turns_sharply(vehicle: VehicleParameters, speed_mps: Array, yaw_rate_radps: Array) -> Flags:
    """Return where (N,) the file's car turns too sharply for a single-track model."""
    base = vehicle.wheelbase_m.value
    return np.asarray(base * np.abs(yaw_rate_radps) >= math.tan(_MAX_TIRE_RAD) * speed_mps)


class Sideways(NamedTuple):
    """A car's sideways motion at N instants, of its centre of gravity, positive to the left."""

    accel_mps2: Array
    speed_mps: Array
    rear_slip_rad: Array
    front_mps2: Array
    """The front axle's force over the car's mass."""


def sideways(
    vehicle: VehicleParameters,
    speed_mps: Array,
    yaw_rate_radps: Array,
    yaw_accel_radps2: Array,
    *,
    period_s: float,
) -> Sideways:
    """Return the sideways motion (N,) of the file's car that turns so; NaN where that is NaN."""
    base, rear = vehicle.wheelbase_m.value, vehicle.cog_from_rear_axle_m.value
    mass, stiffness = vehicle.mass_kg.value, vehicle.rear_cornering_stiffness_npr.value
    fast = np.maximum(speed_mps, SLOWEST_MPS)
    turning = vehicle.yaw_inertia_kgm2.value / mass * yaw_accel_radps2
    accel = speed_mps * yaw_rate_radps
    slip = speed = np.zeros_like(accel)
    for _ in range(2):
        slip = ((base - rear) * accel - turning) / base * mass / stiffness
        speed = rear * yaw_rate_radps - fast * slip
        accel = speed_mps * yaw_rate_radps + np.gradient(speed, period_s)
    return Sideways(accel, speed, slip, (rear * accel + turning) / base)
