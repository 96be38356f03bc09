"""All that one stretch of driving says of a vehicle: estimates, intervals, and reasons against."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.tuning import (
    UNDERSTEER_GRADIENT,
    Identification,
    ParameterEstimate,
    SteeringMapBin,
)
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.sim_worker.analysis.identify import longitudinal
from foretwin.sim_worker.analysis.identify.actuator import fit_following
from foretwin.sim_worker.analysis.identify.longitudinal import grade_from_altitude
from foretwin.sim_worker.analysis.identify.steering import (
    INVERSE_RATIO,
    OFFSET,
    UNDERSTEER,
    SteeringFit,
    fit_steering,
    steering_map,
)
from foretwin.sim_worker.analysis.identify.step import TURNING_MPS2
from foretwin.sim_worker.analysis.motion_record import MotionRecord
from foretwin.sim_worker.vehicle.parameters import understeer_gradient

UNDERSTEER_NAME = UNDERSTEER_GRADIENT
LEAST_TURNING_S, LEAST_STEERING_S = 5.0, 3.0
_WIDE_RATIO, _WIDE_OFFSET_RAD, _WIDE_UNDERSTEER, _WIDE_GAIN, _WIDE_DELAY_S = (
    0.05, 0.005, 0.001, 0.08, 0.03,
)  # fmt: skip
"""Half intervals beyond which an estimate is told and not taken."""


class Examined(NamedTuple):
    """What a record tells, and the fit of its steering where it has one."""

    told: Identification
    steering: SteeringFit | None


class _Interval(NamedTuple):
    value: float
    low: float
    high: float


def _none(name: str, prior: float, reason: str) -> ParameterEstimate:
    return ParameterEstimate(name=name, value=None, low=None, high=None, prior=prior, reason=reason)


def _told(
    name: str, prior: float, interval: tuple[float, float, float], reason: str
) -> ParameterEstimate:
    value, low, high = interval
    if not np.isfinite([value, low, high]).all():
        return _none(name, prior, reason or "the interval has no end")
    return ParameterEstimate(name=name, value=value, low=low, high=high, prior=prior, reason=reason)


def _around(value: float, half: float) -> _Interval:
    return _Interval(value, value - half, value + half)


def turning_s(record: MotionRecord) -> float:
    """Return for how many seconds the car turned."""
    lateral = np.abs(record.speed_mps * record.yaw_rate_radps)
    return float(np.sum(np.nan_to_num(lateral) > TURNING_MPS2) * record.time_s[1])


def identify(
    record: MotionRecord,
    vehicle: VehicleParameters,
    *,
    vehicle_id: str,
    grade: Array | None = None,
) -> Identification:
    """Identify what `record` tells of a car whose parameters in force are `vehicle`.

    `grade` (N,) is the road's rise over run; without it, the record's altitude is asked. An
    estimate may be taken where its `reason` is empty. Raises ValueError for less than 1 s.
    """
    return examine(record, vehicle, vehicle_id=vehicle_id, grade=grade).told


def examine(
    record: MotionRecord,
    vehicle: VehicleParameters,
    *,
    vehicle_id: str,
    grade: Array | None = None,
) -> Examined:
    """Identify as `identify` does, and return the steering's fit along."""
    if len(record.stamp_ns) < 2 or record.time_s[-1] < 1.0:
        raise ValueError(f"{len(record.stamp_ns)} instants are less than a second of driving")
    turned_s = turning_s(record)
    estimates: list[ParameterEstimate] = []
    bins: tuple[SteeringMapBin, ...] = ()
    fit: SteeringFit | None = None
    try:
        fit = fit_steering(record, vehicle)
    except ValueError as lack:
        estimates += [
            _none(name, prior, str(lack)) for name, prior in _steering_priors(vehicle).items()
        ]
    else:
        estimates += _steering(fit, vehicle, turned_s)
        bins = steering_map(record, fit)
    estimates.append(_wheelbase(record, vehicle, turned_s))
    estimates += _following(record, vehicle)
    along, worked_s = _longitudinal(record, vehicle, grade)
    estimates += along
    told = Identification(
        vehicle_id=vehicle_id,
        from_stamp_ns=int(record.stamp_ns[0]),
        stamp_ns=int(record.stamp_ns[-1]),
        estimates=tuple(estimates),
        steering_map=bins,
        excited_s=turned_s + worked_s,
    )
    return Examined(told, fit)


def _steering_priors(vehicle: VehicleParameters) -> dict[str, float]:
    return {
        "steering_ratio": vehicle.steering_ratio.value,
        "steering_offset_rad": vehicle.steering_offset_rad.value,
        UNDERSTEER_NAME: understeer_gradient(vehicle),
    }


def _steering(
    fit: SteeringFit, vehicle: VehicleParameters, turned_s: float
) -> list[ParameterEstimate]:
    still = ""
    if turned_s < LEAST_TURNING_S:
        still = (
            f"nearly straight: the car turned for {turned_s:.1f} s "
            f"(over {TURNING_MPS2:g} m/s² sideways); {LEAST_TURNING_S:g} s are needed"
        )
    covariance = fit.fit.covariance
    alike = covariance[INVERSE_RATIO, UNDERSTEER] / math.sqrt(
        covariance[INVERSE_RATIO, INVERSE_RATIO] * covariance[UNDERSTEER, UNDERSTEER]
    )
    parted = "more bends would narrow it"
    if abs(alike) > 0.8:
        parted = (
            "ratio and understeer gradient cannot be parted at nearly one speed; "
            "bends at other speeds would"
        )
    if fit.hidden_share > 0.01:
        parted = (
            f"play between steering wheel and tyres may make up {100.0 * fit.hidden_share:.0f} % "
            "of so little steering; bends would narrow it"
        )
    ratio = fit.ratio()
    half = max(ratio[2] - ratio[0], ratio[0] - ratio[1])
    wide = {
        "steering_ratio": not half <= _WIDE_RATIO * abs(ratio[0]),
        "steering_offset_rad": fit.half_widths[OFFSET] > _WIDE_OFFSET_RAD,
        UNDERSTEER_NAME: fit.half_widths[UNDERSTEER] > _WIDE_UNDERSTEER,
    }
    intervals = {
        "steering_ratio": ratio,
        "steering_offset_rad": fit.interval(OFFSET),
        UNDERSTEER_NAME: fit.interval(UNDERSTEER),
    }
    result = []
    for name, prior in _steering_priors(vehicle).items():
        reasons = [still] if still else []
        if wide[name]:
            reasons.append(f"the interval is wide: {parted}")
        result.append(_told(name, prior, intervals[name], "; ".join(reasons)))
    return result


def _wheelbase(
    record: MotionRecord, vehicle: VehicleParameters, turned_s: float
) -> ParameterEstimate:
    name, prior = "wheelbase_m", vehicle.wheelbase_m
    if not record.has("tire_rad"):
        return _none(
            name, prior.value,
            "no tyre angle was measured: yaw rate tells wheelbase over steering ratio alone",
        )  # fmt: skip
    direct = msgspec.structs.replace(
        vehicle,
        steering_ratio=Parameter(1.0),
        wheelbase_m=Parameter(prior.value, 0.0, prior.source),
    )
    try:
        fit = fit_steering(record._replace(wheel_rad=record.tire_rad), direct)
    except ValueError as lack:
        return _none(name, prior.value, str(lack))
    value, low, high = (prior.value * ratio for ratio in fit.ratio())
    reason = ""
    if turned_s < LEAST_TURNING_S:
        reason = f"nearly straight: the car turned for {turned_s:.1f} s"
    elif not high - value <= _WIDE_RATIO * value:
        reason = "the interval is wide: bends at other speeds would narrow it"
    return _told(name, prior.value, (value, low, high), reason)


def _following(record: MotionRecord, vehicle: VehicleParameters) -> list[ParameterEstimate]:
    delay, lag = vehicle.steering_delay_s.value, vehicle.steering_lag_s.value
    names = {"steering_delay_s": delay, "steering_lag_s": lag}
    try:
        fit = fit_following(record, vehicle)
    except ValueError as lack:
        return [_none(name, prior, str(lack)) for name, prior in names.items()]
    reason = ""
    if fit.moving_s < LEAST_STEERING_S:
        reason = f"steering moved for {fit.moving_s:.1f} s; {LEAST_STEERING_S:g} s are needed"
    elif fit.delay_half_s > _WIDE_DELAY_S or not 0.0 <= fit.lag_s < 1.0:
        reason = "the interval is wide: quicker steering would narrow it"
    return [
        _told("steering_delay_s", delay, _around(fit.delay_s, fit.delay_half_s), reason),
        _told("steering_lag_s", lag, _around(fit.lag_s, fit.lag_half_s), reason),
    ]


def _longitudinal(
    record: MotionRecord, vehicle: VehicleParameters, grade: Array | None
) -> tuple[list[ParameterEstimate], float]:
    priors = {
        "drive_gain": vehicle.drive_gain, "brake_gain": vehicle.brake_gain,
        "drag_npv2": vehicle.drag_npv2, "rolling_resistance_n": vehicle.rolling_resistance_n,
        "accel_delay_s": vehicle.accel_delay_s,
    }  # fmt: skip
    try:
        if record.has("command_accel_mps2") and grade is None:
            grade = grade_from_altitude(record)
        told = longitudinal.fit_longitudinal(record, vehicle, grade=grade)
    except ValueError as lack:
        return [_none(name, prior.value, str(lack)) for name, prior in priors.items()], 0.0
    short = ""
    needed = (longitudinal.LEAST_DRIVING_S, longitudinal.LEAST_BRAKING_S)
    if told.driving_s < needed[0] or told.braking_s < needed[1]:
        short = longitudinal.too_little(told.driving_s, told.braking_s)
    mass = vehicle.mass_kg.value
    result = []
    for index, (name, prior) in enumerate(priors.items()):
        scale = mass if index in (longitudinal.DRAG, longitudinal.ROLLING) else 1.0
        half = scale * told.fit.half_width(index)
        if index in (longitudinal.DRAG, longitudinal.ROLLING):
            wide = prior.std is not None and half > 1.96 * prior.std
        else:
            wide = half > (_WIDE_DELAY_S if index == longitudinal.DELAY else _WIDE_GAIN)
        reasons = [short] if short else []
        if wide:
            reasons.append("the interval is wide: more driving and braking would narrow it")
        value = scale * float(told.fit.values[index])
        result.append(_told(name, prior.value, _around(value, half), "; ".join(reasons)))
    return result, told.driving_s + told.braking_s
