"""All that one stretch of driving says of a vehicle: estimates, intervals, and reasons against."""

from __future__ import annotations

import math
from collections.abc import Mapping
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
from foretwin.geometry.slopes import Slopes
from foretwin.sim_worker.analysis.identify import longitudinal
from foretwin.sim_worker.analysis.identify.acceptance import ALONG, HALF_OF_95, judged
from foretwin.sim_worker.analysis.identify.actuator import fit_following
from foretwin.sim_worker.analysis.identify.road_grade import grade_from_altitude, grade_from_roads
from foretwin.sim_worker.analysis.identify.steering import SteeringFit, fit_steering, steering_map
from foretwin.sim_worker.analysis.identify.steering_signals import Theta
from foretwin.sim_worker.analysis.identify.step import TURNING_MPS2
from foretwin.sim_worker.analysis.motion_record import MotionRecord
from foretwin.sim_worker.vehicle.parameters import understeer_gradient

UNDERSTEER_NAME = UNDERSTEER_GRADIENT
LEAST_TURNING_S, LEAST_STEERING_S = 5.0, 3.0
_WIDE_RATIO, _WIDE_OFFSET_RAD, _WIDE_UNDERSTEER = 0.05, 0.005, 0.001
_WIDE_GAIN, _WIDE_DELAY_S = 0.08, 0.03
"""Half intervals beyond which an estimate is told and not taken."""
_Interval = tuple[float, float, float]
"""Value, low and high."""


class Examined(NamedTuple):
    """What a record tells, and the fit of its steering where it has one."""

    result: Identification
    steering: SteeringFit | None


def _estimate(
    name: str, prior: float, interval: _Interval | None, *reasons: str
) -> ParameterEstimate:
    """Return an estimate; without an interval, or with one that has no end, it has no value."""
    reason = "; ".join(filter(None, reasons))
    value, low, high = interval or (math.nan, math.nan, math.nan)
    if not np.isfinite([value, low, high]).all():
        return ParameterEstimate(
            name=name,
            value=None,
            low=None,
            high=None,
            prior=prior,
            reason=reason or "the interval has no end",
        )
    return ParameterEstimate(name=name, value=value, low=low, high=high, prior=prior, reason=reason)


def _unknown(priors: Mapping[str, float], lack: ValueError) -> list[ParameterEstimate]:
    return [_estimate(name, prior, None, str(lack)) for name, prior in priors.items()]


def _around(value: float, half: float) -> _Interval:
    return value, value - half, value + half


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
    roads: Slopes | None = None,
) -> Identification:
    """Identify what `record` tells of a car whose parameters in force are `vehicle`.

    `grade` (N,) is the road's rise over run; without it, the record's altitude is asked, and where
    that does not tell it, the map's `roads`. An
    estimate may be taken where its `reason` is empty. Raises ValueError for less than 1 s.
    """
    return examine(record, vehicle, vehicle_id=vehicle_id, grade=grade, roads=roads).result


def examine(
    record: MotionRecord,
    vehicle: VehicleParameters,
    *,
    vehicle_id: str,
    grade: Array | None = None,
    roads: Slopes | None = None,
) -> Examined:
    """Identify as `identify` does, and return the steering's fit along."""
    if len(record.stamp_ns) < 2 or record.time_s[-1] < 1.0:
        raise ValueError(f"{len(record.stamp_ns)} instants are less than a second of driving")
    turned_s = turning_s(record)
    bins: tuple[SteeringMapBin, ...] = ()
    fit: SteeringFit | None = None
    try:
        fit = fit_steering(record, vehicle)
    except ValueError as lack:
        estimates = _unknown(_steering_priors(vehicle), lack)
    else:
        estimates = _steering(fit, vehicle, turned_s)
        bins = steering_map(record, fit)
    along, worked_s = _longitudinal(record, vehicle, grade, roads)
    result = Identification(
        vehicle_id=vehicle_id,
        from_stamp_ns=int(record.stamp_ns[0]),
        stamp_ns=int(record.stamp_ns[-1]),
        estimates=(
            *estimates,
            _wheelbase(record, vehicle, turned_s),
            *_following(record, vehicle),
            *along,
        ),
        steering_map=bins,
        excited_s=turned_s + worked_s,
    )
    return Examined(judged(result, vehicle), fit)


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
    alike = covariance[Theta.INVERSE_RATIO, Theta.UNDERSTEER] / math.sqrt(
        covariance[Theta.INVERSE_RATIO, Theta.INVERSE_RATIO]
        * covariance[Theta.UNDERSTEER, Theta.UNDERSTEER]
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
    # In the order of the priors: the interval, and whether it is too wide.
    found = (
        (ratio, not half <= _WIDE_RATIO * abs(ratio[0])),
        (fit.interval(Theta.OFFSET), fit.half_widths[Theta.OFFSET] > _WIDE_OFFSET_RAD),
        (fit.interval(Theta.UNDERSTEER), fit.half_widths[Theta.UNDERSTEER] > _WIDE_UNDERSTEER),
    )
    return [
        _estimate(name, prior, interval, still, f"the interval is wide: {parted}" if wide else "")
        for (name, prior), (interval, wide) in zip(
            _steering_priors(vehicle).items(), found, strict=True
        )
    ]


def _wheelbase(
    record: MotionRecord, vehicle: VehicleParameters, turned_s: float
) -> ParameterEstimate:
    prior = vehicle.wheelbase_m
    direct = msgspec.structs.replace(
        vehicle,
        steering_ratio=Parameter(1.0),
        wheelbase_m=Parameter(prior.value, 0.0, prior.source),
    )
    interval, reason = None, ""
    try:
        if not record.has("tire_rad"):
            raise ValueError(
                "no tyre angle was measured: yaw rate tells wheelbase over steering ratio alone"
            )
        ratio = fit_steering(record._replace(wheel_rad=record.tire_rad), direct).ratio()
    except ValueError as lack:
        reason = str(lack)
    else:
        value, low, high = (prior.value * one for one in ratio)
        interval = (value, low, high)
        if turned_s < LEAST_TURNING_S:
            reason = f"nearly straight: the car turned for {turned_s:.1f} s"
        elif not high - value <= _WIDE_RATIO * value:
            reason = "the interval is wide: bends at other speeds would narrow it"
    return _estimate("wheelbase_m", prior.value, interval, reason)


def _following(record: MotionRecord, vehicle: VehicleParameters) -> list[ParameterEstimate]:
    delay, lag = vehicle.steering_delay_s.value, vehicle.steering_lag_s.value
    try:
        fit = fit_following(record, vehicle)
    except ValueError as lack:
        return _unknown({"steering_delay_s": delay, "steering_lag_s": lag}, lack)
    reason = ""
    if fit.moving_s < LEAST_STEERING_S:
        reason = f"steering moved for {fit.moving_s:.1f} s; {LEAST_STEERING_S:g} s are needed"
    elif fit.delay_half_s > _WIDE_DELAY_S or not 0.0 <= fit.lag_s < 1.0:
        reason = "the interval is wide: quicker steering would narrow it"
    return [
        _estimate("steering_delay_s", delay, _around(fit.delay_s, fit.delay_half_s), reason),
        _estimate("steering_lag_s", lag, _around(fit.lag_s, fit.lag_half_s), reason),
    ]


def _grade(record: MotionRecord, roads: Slopes | None) -> Array:
    """Return the road's grade: by altitude, which tells it better, or else by the map."""
    try:
        return grade_from_altitude(record)
    except ValueError:
        if roads is None:
            raise
        return grade_from_roads(record, roads)


def _longitudinal(
    record: MotionRecord, vehicle: VehicleParameters, grade: Array | None, roads: Slopes | None
) -> tuple[list[ParameterEstimate], float]:
    priors: dict[str, Parameter] = {name: getattr(vehicle, name) for name in ALONG}
    try:
        if record.has("command_accel_mps2") and grade is None:
            grade = _grade(record, roads)
        along = longitudinal.fit_longitudinal(record, vehicle, grade=grade)
    except ValueError as lack:
        return _unknown({name: prior.value for name, prior in priors.items()}, lack), 0.0
    short = ""
    needed = (longitudinal.LEAST_DRIVING_S, longitudinal.LEAST_BRAKING_S)
    if along.driving_s < needed[0] or along.braking_s < needed[1]:
        short = longitudinal.too_little(along.driving_s, along.braking_s)
    result = []
    for index, (name, prior) in enumerate(priors.items()):
        scale, most = 1.0, _WIDE_DELAY_S if index == longitudinal.DELAY else _WIDE_GAIN
        if index in (longitudinal.DRAG, longitudinal.ROLLING):
            scale = vehicle.mass_kg.value
            most = math.inf if prior.std is None else HALF_OF_95 * prior.std
        half = scale * along.fit.half_width(index)
        wide = "the interval is wide: more driving and braking would narrow it"
        interval = _around(scale * float(along.fit.values[index]), half)
        result.append(_estimate(name, prior.value, interval, short, wide if half > most else ""))
    return result, along.driving_s + along.braking_s
