"""Steering ratio, offset and understeer gradient from yaw rate, speed and the steering wheel.

The model is that of `steering_signals`; the gyro's bias is estimated along, from standstill most
of all.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from contracts.vehicle import VehicleParameters
from sim_worker.identify.regression import Fit, fit_linear
from sim_worker.identify.steering_signals import (
    GYRO_BIAS,
    INVERSE_RATIO,
    OFFSET,
    UNDERSTEER,
    WIDTH_S,
    SteeringSignals,
    steering_signals,
)
from sim_worker.motion_record import MotionRecord
from sim_worker.vehicle.parameters import understeer_gradient

__all__ = ["GYRO_BIAS", "INVERSE_RATIO", "OFFSET", "UNDERSTEER", "SteeringFit", "fit_steering"]

_WEAK = 3.0
"""Priors count with as many times their standard deviation: what the file says carries what the
driving leaves open, and does not pull at what it tells. Intervals hold for any car, not only on
the average of cars like the file's."""
_GYRO_BIAS_STD_RADPS = 0.02
_OFFSET_STD_RAD = 0.1
PLAY_RAD = math.radians(0.6)
"""Between steering wheel and tyres: play, friction, twist and the sensor's steps, as a standard
deviation. On centre it is a good part of the angle, and makes the ratio look too large."""
_PULL_STD_RAD_PER_MPS2 = 0.002
"""A driver corrects half a degree at the steering wheel for each m/s² without a thought."""
_LAG_STD_S = 0.05


class SteeringFit(NamedTuple):
    """`fit` of the parameters that `steering_signals` lists, and what it was fitted to."""

    fit: Fit
    signals: SteeringSignals
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
    signals = steering_signals(record, vehicle)
    used, per_m = signals.used, signals.per_m
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
    alike = 2.0 * math.sqrt(math.pi) * WIDTH_S / float(record.time_s[1])
    play = PLAY_RAD / abs(vehicle.steering_ratio.value) * math.sqrt(np.mean(np.square(per_m)))
    values = centre.copy()
    fit: Fit | None = None
    for _ in range(4):
        apart, slopes = signals.unexplained(values)
        fit = fit_linear(slopes.T, apart + values @ slopes, record.time_s[used],
                         prior=centre, prior_std=spread,
                         least_std=play * math.sqrt(alike))  # fmt: skip
        moved = np.abs(fit.values - values).max()
        values = fit.values
        if moved < 1e-9:
            break
    assert fit is not None
    # What is measured is wheelbase over ratio: the doubt of the first is the second's too.
    std = vehicle.wheelbase_m.std or 0.0
    covariance = fit.covariance.copy()
    covariance[0, 0] += (values[0] * std / vehicle.wheelbase_m.value) ** 2
    varied = float(np.var(signals.wheel_rad[used] * per_m) / np.mean(np.square(per_m)))
    return SteeringFit(
        fit=fit._replace(covariance=covariance),
        signals=signals,
        hidden_share=min(PLAY_RAD**2 / (varied + 1e-12), 0.9),
    )
