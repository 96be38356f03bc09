"""The stand-in's multi-body model in compiled steps, within what steering, drive and brakes can do.

In Python a step took 150 µs, 200 times a second, and more than all else that the stand-in does.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.compiled import OUT, REAL, WHOLE, kernel, types
from foretwin.geometry.multibody_equations import (
    BODY,
    BODY_TYPE,
    STATES,
    STEER,
    TYRE,
    TYRE_TYPE,
    VX,
    slope,
)

_LIMITS = "steering.min steering.max steering.v_min steering.v_max longitudinal.a_max"
_LIMITS += " longitudinal.v_switch longitudinal.v_min longitudinal.v_max"
_LIMITS_TYPE: Any = types.UniTuple(REAL, len(_LIMITS.split()))


class CarNumbers(NamedTuple):
    """The numbers of a car in the order in which `runge_kutta` takes them."""

    limits: tuple[float, ...]
    """What steering and drive can do."""
    body: tuple[float, ...]
    tyre: tuple[float, ...]


def car_numbers(model: Any) -> CarNumbers:
    """Return the numbers of a car of `vehiclemodels`."""
    limits = (name.split(".") for name in _LIMITS.split())
    return CarNumbers(
        limits=tuple(float(getattr(getattr(model, part), name)) for part, name in limits),
        body=tuple(float(getattr(model, name)) for name in BODY),
        tyre=tuple(float(getattr(model.tire, name)) for name in TYRE),
    )


@kernel(types.UniTuple(REAL, 2), REAL, REAL, REAL, REAL, _LIMITS_TYPE)
def within_limits(
    angle: float, rate: float, speed: float, accel: float, limits: tuple[float, ...]
) -> tuple[float, float]:
    """Return the steering rate and the acceleration that the car is able to.

    `steering_constraints` and `acceleration_constraints` of `vehiclemodels`.
    """
    least, most, least_rate, most_rate, most_accel, switch, least_speed, most_speed = limits
    if (angle <= least and rate <= 0.0) or (angle >= most and rate >= 0.0):
        rate = 0.0
    rate = min(max(rate, least_rate), most_rate)
    hardest = most_accel * switch / speed if speed > switch else most_accel
    if (speed <= least_speed and accel <= 0.0) or (speed >= most_speed and accel >= 0.0):
        accel = 0.0
    return rate, min(max(accel, -most_accel), hardest)


@kernel(types.void, OUT, REAL, REAL, _LIMITS_TYPE, BODY_TYPE, TYRE_TYPE, OUT)
def change(
    x: Array,
    rate: float,
    accel: float,
    limits: tuple[float, ...],
    body: tuple[float, ...],
    tyre: tuple[float, ...],
    out: Array,
) -> None:
    """Fill `out` (29,) with the time derivative of a state under what is asked for."""
    rate, accel = within_limits(x[STEER], rate, x[VX], accel, limits)
    slope(x, rate, max(accel, 0.0), max(-accel, 0.0), 0.0, 1.0, 1.0, 1.0, 0.0, body, tyre, out)


@kernel(types.void, OUT, REAL, REAL, WHOLE, REAL, _LIMITS_TYPE, BODY_TYPE, TYRE_TYPE)
def runge_kutta(
    state: Array,
    rate: float,
    accel: float,
    steps: int,
    dt_s: float,
    limits: tuple[float, ...],
    body: tuple[float, ...],
    tyre: tuple[float, ...],
) -> None:
    """Take a state (29,) on by so many steps of the classical method of fourth order."""
    k1, k2, k3, k4 = np.empty(STATES), np.empty(STATES), np.empty(STATES), np.empty(STATES)
    for _ in range(steps):
        change(state, rate, accel, limits, body, tyre, k1)
        change(state + 0.5 * dt_s * k1, rate, accel, limits, body, tyre, k2)
        change(state + 0.5 * dt_s * k2, rate, accel, limits, body, tyre, k3)
        change(state + dt_s * k3, rate, accel, limits, body, tyre, k4)
        state += dt_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
