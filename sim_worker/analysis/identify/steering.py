"""Steering ratio, offset and understeer gradient from yaw rate, speed and the steering wheel.

The model is that of `steering_signals`; the gyro's bias is estimated along, from standstill most
of all.

The steering map is the steering wheel over the effective tyre angle, binned by speed.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.tuning import SteeringMapBin
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.identify.acceptance import HALF_OF_95
from foretwin.sim_worker.analysis.identify.regression import Fit, fit_linear
from foretwin.sim_worker.analysis.identify.steering_signals import (
    ALIKE_S,
    SteeringSignals,
    Theta,
    steering_signals,
)
from foretwin.sim_worker.analysis.motion_record import MotionRecord
from foretwin.sim_worker.vehicle.parameters import understeer_gradient

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
_EVEN_STD = 12.0**-0.5
"""Standard deviation of what is anything between 0 and 1."""
_BEND_STD_RAD, _BEND_S = 4e-4, 9.0
"""What a planar car leaves unexplained of the tyre angle in a bend, and the way to the next one:
so little do a thousand instants of one bend tell."""


class SteeringFit(NamedTuple):
    """`fit` of the parameters that `steering_signals` lists, and what it was fitted to."""

    fit: Fit
    signals: SteeringSignals
    half_widths: Array
    """Of the 95 % intervals (8,)."""
    hidden_share: float
    """Of the steering wheel's variance, what play may account for."""

    def ratio(self) -> tuple[float, float, float]:
        """Return value, low and high of the steering ratio."""
        inverse = float(self.fit.values[Theta.INVERSE_RATIO])
        half = float(self.half_widths[Theta.INVERSE_RATIO])
        size, sign = abs(inverse), math.copysign(1.0, inverse)
        # Errors in a regressor only ever flatten its slope.
        most = size / (1.0 - self.hidden_share) + half
        far = math.inf if size <= half else 1.0 / (size - half)
        low, high = sorted((sign / most, sign * far))
        return 1.0 / inverse, low, high

    def interval(self, index: int) -> tuple[float, float, float]:
        """Return value, low and high of a parameter by its index."""
        value, half = float(self.fit.values[index]), float(self.half_widths[index])
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
    turning = turning_s2(vehicle)
    bias_std = min(signals.gyro_bias_std_radps, _GYRO_BIAS_STD_RADPS)
    priors = {
        Theta.INVERSE_RATIO: (inverse, _inverse_ratio_std(vehicle)),
        Theta.OFFSET: (vehicle.steering_offset_rad.value, _OFFSET_STD_RAD),
        Theta.UNDERSTEER: (understeer_gradient(vehicle), _WEAK * understeer_std(vehicle)),
        Theta.TURNING: (turning, turning),
        Theta.GYRO_BIAS: (signals.gyro_bias_radps, bias_std),
        Theta.LAG: (0.0, _LAG_STD_S * inverse),
        Theta.PULL_DRIVEN: (0.0, _PULL_STD_RAD_PER_MPS2),
        Theta.PULL_BRAKED: (0.0, _PULL_STD_RAD_PER_MPS2),
    }
    centre, spread = np.array([priors[index] for index in Theta]).T.copy()
    weights = signals.weights()
    # Play lasts: instants within the reach of the smoothing share it.
    period_s, angles = float(record.time_s[1]), float(np.mean(np.square(per_m * weights)))
    play = PLAY_RAD / abs(vehicle.steering_ratio.value) * math.sqrt(ALIKE_S / period_s * angles)
    of_bends = max(play, _BEND_STD_RAD * math.sqrt(_BEND_S / period_s * angles))

    def fitted(values: Array, *, least_std: float, brief: bool, more: Array | float = 0.0) -> Fit:
        apart, slopes = signals.unexplained(values)
        return fit_linear(
            (slopes * weights).T,
            (apart + values @ slopes + more) * weights,
            record.time_s[used],
            prior=centre,
            prior_std=spread,
            least_std=least_std,
            brief=brief,
        )

    values = centre
    for _ in range(4):
        fit = fitted(values, least_std=of_bends, brief=False)
        moved = np.abs(fit.values - values).max()
        values = fit.values
        if moved < 1e-9:
            break
    # What is left unexplained lasts for a second or two. Understeer alone is told by how bends of
    # other speeds differ: few, each of which errs in its own way.
    brief = fitted(values, least_std=of_bends, brief=True)
    half_widths = brief.half_widths()
    half_widths[Theta.UNDERSTEER] = fit.half_width(Theta.UNDERSTEER)
    # How the two wheels of the axle are steered, no file says: anything from each across the way to
    # both alike, which bends that are equally tight take for ratio and understeer.
    more = signals.less_if_alike(values)
    alike = fitted(values, least_std=of_bends, brief=False, more=more).values - fit.values
    half_widths = np.hypot(half_widths, HALF_OF_95 * _EVEN_STD * alike)
    # The straights tell the offset, where tyres have nothing to be unexplained.
    straight = fitted(values, least_std=play, brief=True)
    values[Theta.OFFSET], half_widths[Theta.OFFSET] = (
        straight.values[Theta.OFFSET],
        straight.half_width(Theta.OFFSET),
    )
    # What is measured is wheelbase over ratio: the doubt of the first is the second's too.
    base = vehicle.wheelbase_m
    doubt = values[Theta.INVERSE_RATIO] * (base.std or 0.0) / base.value
    half_widths[Theta.INVERSE_RATIO] = math.hypot(
        half_widths[Theta.INVERSE_RATIO], brief.quantile[Theta.INVERSE_RATIO] * doubt
    )
    covariance = fit.covariance.copy()
    # How readily the car turns in, and when, every bend's beginning tells, whatever its radius.
    for index in (Theta.TURNING, Theta.LAG):
        narrower = math.sqrt(min(straight.covariance[index, index] / covariance[index, index], 1.0))
        covariance[index] *= narrower
        covariance[:, index] *= narrower
    covariance[Theta.INVERSE_RATIO, Theta.INVERSE_RATIO] += doubt**2
    varied = float(np.var(signals.wheel_rad[used] * per_m * weights)) / angles
    return SteeringFit(
        fit=fit._replace(covariance=covariance),
        signals=signals,
        half_widths=half_widths,
        hidden_share=min(PLAY_RAD**2 / (varied + 1e-12), 0.9),
    )


EDGES_MPS = (2.0, 5.0, 8.0, 11.0, 15.0, 20.0, 30.0, 45.0)
_LEAST_TYRE_RAD = 0.01
_LEAST_S, _LEAST_BENDS = 2.0, 3
"""Of turning that tells a ratio: a bend errs in its own way from end to end, and how bends differ
no fewer tell."""
_APART_S = 1.0
"""Of driving between two bends. Chosen: a steering wheel that crosses its centre begins another."""


def steering_map(record: MotionRecord, fit: SteeringFit) -> tuple[SteeringMapBin, ...]:
    """Return the ratio in each range of speeds with 2 s of turning and three bends at least.

    A ratio that falls with speed in spite of the fitted understeer tells of variable-ratio
    steering; `fit` is that of the same `record`.
    """
    period_s = float(record.time_s[1])
    signals, values = fit.signals, fit.fit.values
    at = signals.used
    speed, wheel = signals.speed_mps[at], signals.late_wheel_rad(values)[at]
    tyre = signals.steered_rad(values)[at]
    bins = []
    for low, high in itertools.pairwise(EDGES_MPS):
        inside = (speed >= low) & (speed < high) & (np.abs(tyre) > _LEAST_TYRE_RAD)
        if inside.sum() * period_s < _LEAST_S:
            continue
        time_s = record.time_s[at][inside]
        if _bends(time_s, tyre[inside]) < _LEAST_BENDS:
            continue
        try:
            line = fit_linear(wheel[inside][:, None], tyre[inside], time_s)
        except ValueError:
            continue
        inverse, half = float(line.values[0]), line.half_width(0)
        if inverse <= half:
            continue
        bins.append(
            SteeringMapBin(
                from_mps=low,
                to_mps=high,
                ratio=1.0 / inverse,
                low=1.0 / (inverse + half),
                high=1.0 / (inverse - half),
                samples=int(inside.sum()),
            )
        )
    return tuple(bins)


def _bends(time_s: Array, tyre_rad: Array) -> int:
    """Return how many bends turning (N,) is of: each to one side, and apart from the others."""
    begins = (np.diff(time_s) > _APART_S) | (np.diff(np.sign(tyre_rad)) != 0.0)
    return 1 + int(np.count_nonzero(begins))
