"""Steering ratio, offset and understeer gradient from yaw rate, speed and the steering wheel.

A single-track car's rear axle turns with r = v/L tan(w/i + δ0 - K v r - T dr/dt), with steering
wheel w, ratio i, offset δ0 at the tyre, understeer gradient K (Gillespie 1992, eq. 6-15), and
T = I_z/L (1/C_f + 1/C_r) for what the tyres need to turn the body. The gyro's bias is estimated
along, from standstill most of all.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from contracts.arrays import Array
from contracts.vehicle import VehicleParameters
from sim_worker.identify.regression import Fit, fit_linear, stretches
from sim_worker.identify.smoothing import smoothed
from sim_worker.motion_record import MotionRecord
from sim_worker.vehicle.parameters import understeer_gradient

Indices = np.ndarray[Any, np.dtype[np.int64]]
WIDTH_S = 0.1
_SLOWEST_MPS = 2.0
_MAX_LATERAL_MPS2 = 4.0
"""Beyond it, tyres are no longer linear."""
_GYRO_BIAS_STD_RADPS = 0.02
_OFFSET_STD_RAD = 0.1
_PLAY_RAD = math.radians(0.6)
"""Between steering wheel and tyres: play, friction, twist and the sensor's steps, as a standard
deviation. On centre it is a good part of the angle, and makes the ratio look too large."""
INVERSE_RATIO, OFFSET, UNDERSTEER, TURNING, GYRO_BIAS = range(5)


class SteeringFit(NamedTuple):
    """`fit` of 1/ratio, offset, K, T and gyro bias; what each instant (N,) was and was told."""

    fit: Fit
    used: Indices
    """Instants that counted, as indices."""
    speed_mps: Array
    yaw_rate_radps: Array
    wheel_rad: Array
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
    return 3.0 * (ratio.std or 0.2 * abs(ratio.value)) / ratio.value**2


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
    wheel = smoothed(record.wheel_rad, period_s=period_s, width_s=WIDTH_S)
    speed = smoothed(record.speed_mps, period_s=period_s, width_s=WIDTH_S)
    rate = smoothed(record.yaw_rate_radps, period_s=period_s, width_s=WIDTH_S)
    turning = smoothed(record.yaw_rate_radps, period_s=period_s, width_s=WIDTH_S, derivative=True)
    known = np.isfinite(wheel) & np.isfinite(speed) & np.isfinite(rate)
    lateral = speed * rate
    moving = known & (speed > _SLOWEST_MPS) & (np.abs(lateral) < _MAX_LATERAL_MPS2)
    standing = known & (np.abs(speed) < 1e-3)
    if not moving.any():
        raise ValueError("the car did not drive")
    used = np.flatnonzero(moving | standing)
    base = vehicle.wheelbase_m.value
    per_m = np.where(moving, speed, 0.0)[used] / base
    w, r, dr, ay = wheel[used], rate[used], turning[used], lateral[used]
    std = vehicle.wheelbase_m.std or 0.0
    centre = np.array(
        [1.0 / vehicle.steering_ratio.value, vehicle.steering_offset_rad.value,
         understeer_gradient(vehicle), turning_s2(vehicle), 0.0]
    )  # fmt: skip
    spread = np.array(
        [_inverse_ratio_std(vehicle), _OFFSET_STD_RAD, 1.5 * understeer_std(vehicle),
         turning_s2(vehicle), _GYRO_BIAS_STD_RADPS]
    )  # fmt: skip
    stretch = stretches(record.time_s[used])
    # Play lasts: instants within the reach of the smoothing share it.
    alike = 2.0 * math.sqrt(math.pi) * WIDTH_S / period_s
    play = _PLAY_RAD / abs(vehicle.steering_ratio.value) * math.sqrt(np.mean(np.square(per_m)))
    values = centre.copy()
    fit: Fit | None = None
    for _ in range(4):
        tyre = values[0] * w + values[1] - values[2] * ay - values[3] * dr
        tyre = np.clip(tyre, -1.2, 1.2)
        slope = per_m * (1.0 + np.square(np.tan(tyre)))
        columns = np.stack([slope * w, slope, -slope * ay, -slope * dr, np.ones_like(r)], axis=1)
        model = per_m * np.tan(tyre) + values[4]
        fit = fit_linear(columns, r - model + columns @ values, stretch, prior=centre,
                         prior_std=spread, least_std=play * math.sqrt(alike))  # fmt: skip
        moved = np.abs(fit.values - values).max()
        values = fit.values
        if moved < 1e-9:
            break
    assert fit is not None
    # What is measured is wheelbase over ratio: the doubt of the first is the second's too.
    covariance = fit.covariance.copy()
    covariance[0, 0] += (values[0] * std / base) ** 2
    weight = np.where(moving, speed, 0.0)[used]
    varied = float(np.var(w * weight) / np.mean(np.square(weight)))
    return SteeringFit(
        fit=fit._replace(covariance=covariance),
        used=used,
        speed_mps=speed,
        yaw_rate_radps=rate,
        wheel_rad=wheel,
        hidden_share=min(_PLAY_RAD**2 / (varied + 1e-12), 0.9),
    )
