"""Steering ratio, offset and understeer gradient from yaw rate, speed and the steering wheel.

A single-track car turns with r = v/L (tan(δ - β) + β), where β is its rear tyres' slip and

    δ = (w - τ dw/dt)/i + δ0 + p⁺ a⁺ + p⁻ a⁻ - K a_y - T dr/dt

with steering wheel w, ratio i, offset δ0 at the tyre, understeer gradient K (Gillespie 1992, eq.
6-15), T = I_z/L (1/C_f + 1/C_r) for what the tyres need to turn the body, τ by which the tyres (or
the gyro's samples) come after the steering wheel, and p± by which the car pulls to a side when it
is driven or braked. The gyro's bias is estimated along, from standstill most of all.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from contracts.arrays import Array
from contracts.vehicle import VehicleParameters
from sim_worker.identify.regression import Fit, fit_linear
from sim_worker.identify.single_track import SLOWEST_MPS, sideways
from sim_worker.identify.smoothing import smoothed
from sim_worker.motion_record import MotionRecord
from sim_worker.vehicle.parameters import understeer_gradient

Indices = np.ndarray[Any, np.dtype[np.int64]]
WIDTH_S = 0.1
_MAX_LATERAL_MPS2 = 4.0
"""Beyond it, tyres are no longer linear."""
_WEAK = 3.0
"""Priors count with as many times their standard deviation: what the file says carries what the
driving leaves open, and does not pull at what it tells. Intervals hold for any car, not only on
the average of cars like the file's."""
_GYRO_BIAS_STD_RADPS = 0.02
_OFFSET_STD_RAD = 0.1
_PLAY_RAD = math.radians(0.6)
"""Between steering wheel and tyres: play, friction, twist and the sensor's steps, as a standard
deviation. On centre it is a good part of the angle, and makes the ratio look too large."""
_PULL_STD_RAD_PER_MPS2 = 0.002
"""A driver corrects half a degree at the steering wheel for each m/s² without a thought."""
_LAG_STD_S = 0.05
INVERSE_RATIO, OFFSET, UNDERSTEER, TURNING, GYRO_BIAS, LAG, PULL_DRIVEN, PULL_BRAKED = range(8)


class SteeringFit(NamedTuple):
    """`fit` of 1/ratio, offset, K, T, gyro bias, τ, p⁺, p⁻; what each instant (N,) was and said."""

    fit: Fit
    used: Indices
    """Instants that counted, as indices."""
    speed_mps: Array
    yaw_rate_radps: Array
    wheel_rad: Array
    """The steering wheel τ before."""
    steered_rad: Array
    """The tyre angle that the motion asks the steering wheel for."""
    hidden_share: float
    """Of the steering wheel's variance, what play may account for."""

    def ratio(self) -> tuple[float, float, float]:
        """Return value, low and high of the steering ratio."""
        inverse = float(self.fit.values[INVERSE_RATIO])
        half = self.fit.half_width(INVERSE_RATIO)
        size, sign = abs(inverse), math.copysign(1.0, inverse)
        # Errors in a regressor only ever flatten its slope.
        most = size / (1.0 - self.hidden_share) + half
        far = math.inf if size <= half else 1.0 / (size - half)
        low, high = sorted((sign / most, sign * far))
        return 1.0 / inverse, low, high

    def interval(self, index: int) -> tuple[float, float, float]:
        """Return value, low and high of a parameter by its index."""
        value, half = float(self.fit.values[index]), self.fit.half_width(index)
        return value, value - half, value + half


def understeer_std(vehicle: VehicleParameters) -> float:
    """Return how uncertain the file's tyre stiffnesses leave the understeer gradient."""
    front, rear = vehicle.front_cornering_stiffness_npr, vehicle.rear_cornering_stiffness_npr
    share = vehicle.cog_from_rear_axle_m.value / vehicle.wheelbase_m.value
    mass = vehicle.mass_kg.value
    of_front = mass * share / front.value**2 * (front.std or 0.0)
    of_rear = mass * (1.0 - share) / rear.value**2 * (rear.std or 0.0)
    return max(math.hypot(of_front, of_rear), 5e-4)


def turning_s2(vehicle: VehicleParameters) -> float:
    """Return T, the tyre angle per yaw acceleration, of the file's parameters."""
    soft = 1.0 / vehicle.front_cornering_stiffness_npr.value
    soft += 1.0 / vehicle.rear_cornering_stiffness_npr.value
    return vehicle.yaw_inertia_kgm2.value / vehicle.wheelbase_m.value * soft


def _inverse_ratio_std(vehicle: VehicleParameters) -> float:
    ratio = vehicle.steering_ratio
    return _WEAK * (ratio.std or 0.2 * abs(ratio.value)) / ratio.value**2


def fit_steering(record: MotionRecord, vehicle: VehicleParameters) -> SteeringFit:
    """Fit the steering of a record at even instants; raises ValueError saying what it lacks."""
    for name, told in (
        ("wheel_rad", "steering-wheel angle"),
        ("speed_mps", "speed"),
        ("yaw_rate_radps", "yaw rate"),
    ):
        if not record.has(name):
            raise ValueError(f"no {told} was measured for half of the time")
    period_s = float(record.time_s[1])

    def smooth(values: Array, *, derivative: bool = False) -> Array:
        return smoothed(values, period_s=period_s, width_s=WIDTH_S, derivative=derivative)

    speed, rate, wheel = map(smooth, (record.speed_mps, record.yaw_rate_radps, record.wheel_rad))
    turning, gaining, steering = (
        smooth(values, derivative=True)
        for values in (record.yaw_rate_radps, record.speed_mps, record.wheel_rad)
    )
    side = sideways(vehicle, speed_mps=speed, yaw_rate_radps=rate, yaw_accel_radps2=turning,
                    period_s=period_s)  # fmt: skip
    known = np.isfinite(wheel) & np.isfinite(side.accel_mps2)
    moving = known & (speed > SLOWEST_MPS) & (np.abs(side.accel_mps2) < _MAX_LATERAL_MPS2)
    standing = known & (np.abs(speed) < 1e-3)
    if not moving.any():
        raise ValueError("the car did not drive")
    used = np.flatnonzero(moving | standing)
    base = vehicle.wheelbase_m.value
    per_m = np.where(moving, speed, 0.0)[used] / base
    r, slip = rate[used], side.rear_slip_rad[used]
    given = np.stack(
        [wheel, np.ones_like(wheel), -side.accel_mps2, -turning, np.zeros_like(wheel), -steering,
         np.maximum(gaining, 0.0), np.minimum(gaining, 0.0)]
    )  # fmt: skip
    asked = given[:, used]
    std = vehicle.wheelbase_m.std or 0.0
    inverse = 1.0 / vehicle.steering_ratio.value
    centre = np.array(
        [inverse, vehicle.steering_offset_rad.value, understeer_gradient(vehicle),
         turning_s2(vehicle), 0.0, 0.0, 0.0, 0.0]
    )  # fmt: skip
    spread = np.array(
        [_inverse_ratio_std(vehicle), _OFFSET_STD_RAD, _WEAK * understeer_std(vehicle),
         turning_s2(vehicle), _GYRO_BIAS_STD_RADPS, _LAG_STD_S * inverse,
         _PULL_STD_RAD_PER_MPS2, _PULL_STD_RAD_PER_MPS2]
    )  # fmt: skip
    # Play lasts: instants within the reach of the smoothing share it.
    alike = 2.0 * math.sqrt(math.pi) * WIDTH_S / period_s
    play = _PLAY_RAD / abs(vehicle.steering_ratio.value) * math.sqrt(np.mean(np.square(per_m)))
    values = centre.copy()
    fit: Fit | None = None
    for _ in range(4):
        front = np.clip(values @ asked - slip, -1.2, 1.2)
        slope = per_m * (1.0 + np.square(np.tan(front)))
        columns = asked * slope
        columns[GYRO_BIAS] = 1.0
        model = per_m * (np.tan(front) + slip) + values[GYRO_BIAS]
        fit = fit_linear(columns.T, r - model + values @ columns, record.time_s[used],
                         prior=centre, prior_std=spread,
                         least_std=play * math.sqrt(alike))  # fmt: skip
        moved = np.abs(fit.values - values).max()
        values = fit.values
        if moved < 1e-9:
            break
    assert fit is not None
    # What is measured is wheelbase over ratio: the doubt of the first is the second's too.
    covariance = fit.covariance.copy()
    covariance[0, 0] += (values[0] * std / base) ** 2
    weight = np.where(moving, speed, 0.0)[used]
    varied = float(np.var(wheel[used] * weight) / np.mean(np.square(weight)))
    by_wheel = values[INVERSE_RATIO] * wheel - values[LAG] * steering
    turned = base * (rate - values[GYRO_BIAS]) / np.maximum(speed, SLOWEST_MPS)
    tyre = np.arctan(turned - side.rear_slip_rad) + side.rear_slip_rad
    return SteeringFit(
        fit=fit._replace(covariance=covariance),
        used=used,
        speed_mps=speed,
        yaw_rate_radps=rate,
        wheel_rad=by_wheel / values[INVERSE_RATIO],
        steered_rad=tyre - (values @ given - by_wheel),
        hidden_share=min(_PLAY_RAD**2 / (varied + 1e-12), 0.9),
    )
