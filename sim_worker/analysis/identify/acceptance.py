"""Which estimates are taken into a vehicle's parameters, and the file that holds them."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping

import msgspec

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.contracts.tuning import (
    UNDERSTEER_GRADIENT,
    Identification,
    ParameterChange,
    ParameterEstimate,
)
from foretwin.contracts.vehicle import Parameter, VehicleParameters
from foretwin.sim_worker.vehicle.parameters import check_vehicle, understeer_gradient
from foretwin.sim_worker.vehicle.plausible import PLAUSIBLE
from foretwin.sim_worker.vehicle.similarity import in_world_size

HALF_OF_95 = 1.96
"""Standard deviations to either side that hold 95 % of a Gaussian."""
MUCH_WIDER = 1.5
"""Times the standard deviation before: what is known so much worse is no news. Chosen."""
STIFFNESS = "front_cornering_stiffness_npr"
STEERING = ("steering_ratio", "steering_offset_rad", UNDERSTEER_GRADIENT)
ALONG = ("drive_gain", "brake_gain", "drag_npv2", "rolling_resistance_n", "accel_delay_s")
"""What one fit tells, of how the car turns and of how it speeds up and slows down."""
_TELLING = {"steering_ratio": STEERING, "drive_gain": ALONG, "brake_gain": ALONG}
"""Where one of these is no vehicle's, the signals are not what they are said to be, and nothing
that was fitted along with it is right."""

_RESTING_ON = {
    "speed_sensor": (*STEERING, "wheelbase_m", *ALONG),
    "gyro_sensor": (*STEERING, "wheelbase_m"),
}
"""What is told by a sensor. Of a gyro, speeding up asks no more than what bends take of it."""


def is_acceptable(estimate: ParameterEstimate) -> bool:
    """Return whether an estimate has a value and nothing speaks against it."""
    return estimate.value is not None and not estimate.reason


def std_of(estimate: ParameterEstimate) -> float:
    """Return the standard deviation of an estimate that has a value."""
    assert estimate.high is not None
    assert estimate.low is not None
    return (estimate.high - estimate.low) / (2.0 * HALF_OF_95)


def front_stiffness(vehicle: VehicleParameters, gradient_rad_per_mps2: float) -> float:
    """Return the front axle's cornering stiffness that gives an understeer gradient.

    The rear's stays: yaw rate tells their difference alone. Raises ValueError for a car that
    oversteers more than any front tyre could account for.
    """
    base, rear = vehicle.wheelbase_m.value, vehicle.cog_from_rear_axle_m.value
    mass = vehicle.mass_kg.value
    soft = mass * (base - rear) / (base * vehicle.rear_cornering_stiffness_npr.value)
    soft += gradient_rad_per_mps2
    if not soft > 0.0:
        raise ValueError(f"no front stiffness gives {gradient_rad_per_mps2:g} rad per m/s²")
    return mass * rear / (base * soft)


def accepted(
    result: Identification,
    vehicle: VehicleParameters,
    *,
    pinned: Collection[str] = (),
    source: str = "identified",
) -> tuple[VehicleParameters, tuple[ParameterChange, ...]]:
    """Return `vehicle` with what may be taken of `result`, and each change.

    An understeer gradient becomes the front axle's cornering stiffness, `pinned` under either
    name. What would make no vehicle (a negative drag), or an implausible one, is passed over.
    """
    changes: list[ParameterChange] = []
    for estimate in judged(result, vehicle).estimates:
        if not is_acceptable(estimate) or estimate.name in pinned:
            continue
        if estimate.name == UNDERSTEER_GRADIENT and STIFFNESS in pinned:
            continue
        name, parameter = _parameter(estimate, vehicle)
        before = getattr(vehicle, name).value
        parameter = msgspec.structs.replace(parameter, source=f"{source}, {result.excited_s:.0f} s")
        vehicle = msgspec.structs.replace(vehicle, **{name: parameter})
        changes.append(
            ParameterChange(
                vehicle_id=result.vehicle_id,
                stamp_ns=result.stamp_ns,
                name=name,
                before=before,
                value=parameter.value,
                std=parameter.std,
                origin="identified",
            )
        )
    return vehicle, tuple(changes)


def judged(result: Identification, vehicle: VehicleParameters) -> Identification:
    """Return an identification that says of what would make no vehicle of `vehicle`, or an
    implausible one, that it does, and what else cannot be right then."""
    against: dict[str, str] = {}
    for estimate in result.estimates:
        if reason := _implausible(estimate, vehicle):
            for name in _TELLING.get(estimate.name, ()):
                against.setdefault(name, f"it was told along with {estimate.name}, which is wrong")
            against[estimate.name] = reason
    return _with_reasons(result, against)


def doubted(result: Identification, wrong: Mapping[str, str]) -> Identification:
    """Return an identification in which nothing may be taken that rests on a sensor in `wrong`.

    That says what is wrong, by `speed_sensor` and `gyro_sensor`.
    """
    against: dict[str, str] = {}
    for sensor, reason in wrong.items():
        for name in _RESTING_ON[sensor]:
            against.setdefault(name, reason)
    if wrong:
        result = msgspec.structs.replace(result, steering_map=())
    return _with_reasons(result, against)


def _with_reasons(result: Identification, against: Mapping[str, str]) -> Identification:
    """Return an identification that has these reasons, by name, against what has a value."""
    estimates = tuple(
        msgspec.structs.replace(found, reason=against[found.name])
        if found.value is not None and found.name in against
        else found
        for found in result.estimates
    )
    return msgspec.structs.replace(result, estimates=estimates)


def _implausible(estimate: ParameterEstimate, vehicle: VehicleParameters) -> str:
    """Return why no road vehicle has this value, or any of its interval where that is wide."""
    tried = [estimate]
    if estimate.value is None:
        return ""
    if estimate.reason:
        ends = (estimate.low, estimate.high)
        tried += [msgspec.structs.replace(estimate, value=end) for end in ends]
    reason = ""
    for one in tried:
        try:
            name, parameter = _parameter(one, vehicle)
            check_vehicle(msgspec.structs.replace(vehicle, **{name: parameter}), before=vehicle)
        except ValueError as error:
            reason = reason or str(error)
        else:
            return ""
    if estimate.name in _TELLING:
        reason += "; is the unit or the sign of a signal another than was declared?"
    return reason


def _parameter(estimate: ParameterEstimate, vehicle: VehicleParameters) -> tuple[str, Parameter]:
    """Return the parameter of `vehicle` that an estimate with a value tells, by its name.

    Raises ValueError for an understeer gradient that no front stiffness gives.
    """
    assert estimate.value is not None
    value, std = estimate.value, std_of(estimate)
    if estimate.name != UNDERSTEER_GRADIENT:
        return estimate.name, Parameter(value, std)
    stiffness = front_stiffness(vehicle, value)
    return STIFFNESS, Parameter(stiffness, abs(stiffness - front_stiffness(vehicle, value + std)))


def vehicle_toml(vehicle: VehicleParameters, *, scale: float = 1.0) -> str:
    """Return the text of a parameter file that `load_vehicle` reads as `vehicle`, which is `scale`
    times as large as the car is: the file holds that in its own size."""
    lines = [f"name = {json.dumps(vehicle.name)}"]
    if scale != 1.0:
        lines.append(f"scale = {scale!r}")
        vehicle = in_world_size(vehicle, 1.0 / scale)
    for field in msgspec.structs.fields(vehicle):
        parameter = getattr(vehicle, field.name)
        if not isinstance(parameter, Parameter):
            continue
        lines += ["", f"[{field.name}]", f"value = {float(parameter.value)!r}"]
        if parameter.std is not None:
            lines.append(f"std = {float(parameter.std)!r}")
        lines.append(f"source = {json.dumps(parameter.source, ensure_ascii=False)}")
    return "\n".join(lines) + "\n"


def in_force(vehicle: VehicleParameters, name: str) -> float:
    """Return the value of a parameter, derived ones included; UserError for another name."""
    if name == UNDERSTEER_GRADIENT:
        return understeer_gradient(vehicle)
    parameter = getattr(vehicle, name, None)
    if not isinstance(parameter, Parameter):
        raise UserError(f"{name} is no parameter of a vehicle; {one_of(name, PLAUSIBLE)}")
    return float(parameter.value)


def with_priors(result: Identification, vehicle: VehicleParameters) -> Identification:
    """Return an identification whose estimates stand beside the values of `vehicle`."""
    estimates = tuple(
        msgspec.structs.replace(found, prior=in_force(vehicle, found.name))
        for found in result.estimates
    )
    return msgspec.structs.replace(result, estimates=estimates)


def is_left_open(vehicle: VehicleParameters, name: str, value: float) -> bool:
    """Return whether a value lies within two standard deviations of what a vehicle file says."""
    if name == UNDERSTEER_GRADIENT:
        usual = understeer_gradient(vehicle)
        parts = ("front_cornering_stiffness_npr", "rear_cornering_stiffness_npr")
        softer = (understeer_gradient(_softer(vehicle, part)) for part in parts)
        std = math.hypot(*(one - usual for one in softer))
    else:
        usual, std = in_force(vehicle, name), getattr(vehicle, name).std or 0.0
    return abs(value - usual) <= 2.0 * std


def _softer(vehicle: VehicleParameters, name: str) -> VehicleParameters:
    given: Parameter = getattr(vehicle, name)
    softer = Parameter(given.value - (given.std or 0.0), given.std, given.source)
    return msgspec.structs.replace(vehicle, **{name: softer})
