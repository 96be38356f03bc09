"""Drive and brake gain, dead time, drag and rolling resistance from command, speed and grade.

On the road, e a = G_d u⁺ - G_b u⁻ - (c v² + R)/m - g sin(grade), with the effective mass factor e,
the command u of `accel_delay_s` ago, drive and brake gains G, drag c and rolling resistance R.
Acceleration is the slope of the measured speed: an accelerometer would feel the body's pitch. In a
bend it contains what the turned front wheels take, F_yf sin(δ), up to 0.2 m/s² in town; in sharp
ones, near full lock, tyres scrub and take more than this tells, and they are left out. What is
left is noise of the measured speed: over 6 s it averages out as white noise does.
"""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.analysis.identify.actuator import MAX_DELAY_S, best_delay, known_back
from foretwin.sim_worker.analysis.identify.regression import (
    Fit,
    delayed,
    fit_linear,
    smoothed,
    smoothed_and_rate,
)
from foretwin.sim_worker.analysis.identify.steering_signals import (
    SLOWEST_MPS,
    WIDTH_S,
    sideways,
    turns_sharply,
)
from foretwin.sim_worker.analysis.motion_record import MotionRecord
from foretwin.sim_worker.vehicle.parameters import GRAVITY_MPS2

DRIVE, BRAKE, DRAG, ROLLING, DELAY = range(5)
_DRIVES_MPS2 = 0.3
LEAST_DRIVING_S, LEAST_BRAKING_S, _LEAST_S = 4.0, 3.0, 1.0


class LongitudinalFit(NamedTuple):
    """`fit` of drive gain, brake gain, drag/m, rolling/m and dead time (K = 5)."""

    fit: Fit
    driving_s: float
    braking_s: float
    """Seconds with a command of more than 0.3 m/s² either way."""


def too_little(driving_s: float, braking_s: float) -> str:
    """Return in words that the driving told too little."""
    return (
        f"the car was driven for {driving_s:.1f} s and braked for {braking_s:.1f} s "
        f"(over {_DRIVES_MPS2:g} m/s²); {LEAST_DRIVING_S:g} s and {LEAST_BRAKING_S:g} s are needed"
    )


def _first_order(values: Array, *, period_s: float, lag_s: float) -> Array:
    if lag_s <= 0.0:
        return values
    decay = float(np.exp(-period_s / lag_s))
    # scipy.signal has this, and takes a second to import.
    steps = ((1.0 - decay) * np.nan_to_num(values)).tolist()
    filtered = np.array(list(accumulate(steps, lambda before, step: step + decay * before)))
    return np.where(np.isfinite(values), filtered, np.nan)


def _cornering(record: MotionRecord, vehicle: VehicleParameters, speed_mps: Array) -> Array:
    """Return the deceleration (N,) of a single-track car that turns and rolls freely, NaN where it
    turns so sharply that it is none."""
    if not record.has("yaw_rate_radps"):
        return np.zeros(len(speed_mps))
    period_s = float(record.time_s[1])
    rate, turning = smoothed_and_rate(record.yaw_rate_radps, period_s=period_s, width_s=WIDTH_S)
    base, rear = vehicle.wheelbase_m.value, vehicle.cog_from_rear_axle_m.value
    side = sideways(vehicle, speed_mps, rate, turning, period_s=period_s)
    ahead = np.arctan2(side.speed_mps + (base - rear) * rate, np.maximum(speed_mps, SLOWEST_MPS))
    slip = side.front_mps2 * vehicle.mass_kg.value / vehicle.front_cornering_stiffness_npr.value
    slowing = side.front_mps2 * np.sin(ahead + slip) - rate * side.speed_mps
    return np.where(turns_sharply(vehicle, speed_mps, rate), np.nan, slowing)


def _spinning_s(vehicle: VehicleParameters, speed_mps: Array) -> Array:
    """Return how long (N,) the wheels take to spin up to the slip that carries a force.

    Their inertia times speed over the tyres' slip stiffness, which is about their cornering
    stiffness (Pacejka 2012, section 8.2): 2 ms in town, and no delay of the actuator.
    """
    inertia = (vehicle.wheel_inertia_mass_factor.value - 1.0) * vehicle.mass_kg.value
    stiffness = vehicle.front_cornering_stiffness_npr.value
    stiffness += vehicle.rear_cornering_stiffness_npr.value
    return np.asarray(inertia * speed_mps / stiffness)


def fit_longitudinal(
    record: MotionRecord, vehicle: VehicleParameters, *, grade: Array | None
) -> LongitudinalFit:
    """Fit command to motion; `grade` (N,) is the slope, rise over run. ValueError if one lacks."""
    if not record.has("command_accel_mps2"):
        raise ValueError("no acceleration was commanded")
    if not record.has("speed_mps"):
        raise ValueError("no speed was measured for half of the time")
    if grade is None:
        raise ValueError("the road's grade is unknown: 5 % of it is more than drag")
    period_s = float(record.time_s[1])
    speed, accel = smoothed_and_rate(record.speed_mps, period_s=period_s, width_s=WIDTH_S)
    climbing = smoothed(np.sin(np.arctan(grade)), period_s=period_s, width_s=WIDTH_S)
    lags = (vehicle.drive_lag_s.value, vehicle.brake_lag_s.value)
    parts = []
    for sign, lag_s in zip((1.0, -1.0), lags, strict=True):
        part = np.where(sign * record.command_accel_mps2 > 0.0, record.command_accel_mps2, 0.0)
        part[~np.isfinite(record.command_accel_mps2)] = np.nan
        part = _first_order(part, period_s=period_s, lag_s=lag_s)
        held = smoothed(part, period_s=period_s, width_s=WIDTH_S)
        parts.append(delayed(held, period_s=period_s, delay_s=0.5 * period_s))
    bends = _cornering(record, vehicle, speed)
    usable = np.isfinite(speed) & np.isfinite(accel) & np.isfinite(climbing) & ~record.manual
    usable &= np.isfinite(bends)
    # The smoothing must not reach into standstill, where brakes hold rather than slow.
    usable &= speed > SLOWEST_MPS
    slopes = [np.gradient(part, period_s) for part in parts]
    usable &= known_back(slopes[0] + slopes[1], period_s=period_s)
    used = np.flatnonzero(usable)
    if len(used) < 100:
        raise ValueError("the car did not drive by command")
    asked = record.command_accel_mps2[used]
    driving_s = float(np.sum(asked > _DRIVES_MPS2) * period_s)
    braking_s = float(np.sum(asked < -_DRIVES_MPS2) * period_s)
    if min(driving_s, braking_s) < _LEAST_S:
        raise ValueError(too_little(driving_s, braking_s))
    effective = vehicle.wheel_inertia_mass_factor.value
    target = effective * accel[used] + bends[used] + GRAVITY_MPS2 * climbing[used]
    v = speed[used]
    slow_s = _spinning_s(vehicle, v)

    def acting(delay_s: float) -> Array:
        pushes = [
            delayed(part, period_s=period_s, delay_s=delay_s)[used]
            - slow_s * delayed(slope, period_s=period_s, delay_s=delay_s)[used]
            for part, slope in zip(parts, slopes, strict=True)
        ]
        return np.stack([*pushes, -np.square(v), -np.ones_like(v)], axis=1)

    delay_s = best_delay(acting, target)
    mass, drag, rolling = vehicle.mass_kg.value, vehicle.drag_npv2, vehicle.rolling_resistance_n
    # The dead time is a step from the last one; the file tells the losses alone.
    priors = (
        (vehicle.drive_gain.value, np.inf),
        (vehicle.brake_gain.value, np.inf),
        (drag.value / mass, 2.0 * (drag.std or 0.4) / mass),
        (rolling.value / mass, 2.0 * (rolling.std or 130.0) / mass),
        (0.0, np.inf),
    )
    centre, spread = np.array(priors).T
    gains = centre[:2]
    fit: Fit | None = None
    for _ in range(4):
        changing = [delayed(slope, period_s=period_s, delay_s=delay_s)[used] for slope in slopes]
        moved = -(gains[0] * changing[0] + gains[1] * changing[1])
        columns = np.column_stack([acting(delay_s), moved])
        fit = fit_linear(
            columns, target, record.time_s[used], prior=centre, prior_std=spread, brief=True
        )
        gains = fit.values[:2]
        delay_s = float(np.clip(delay_s + fit.values[DELAY], 0.0, MAX_DELAY_S))
    assert fit is not None
    values = fit.values.copy()
    values[DELAY] = delay_s
    return LongitudinalFit(fit._replace(values=values), driving_s, braking_s)
