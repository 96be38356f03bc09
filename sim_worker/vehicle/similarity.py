"""A small car as large as the road vehicles of a World: the same motion, in other units of length.

Times stay and lengths grow n times, so that speeds and accelerations grow n times as well and an
anchor of that scale carries each onto the other. Gravity does not grow: the grip µ g must, so that
µ grows n times, and the share of weight that braking shifts, h a / (l g), stays with a height h
that stays. Slopes are not similar: a lot is flat. Barenblatt (1996), Scaling, Self-similarity, and
Intermediate Asymptotics.
"""

from __future__ import annotations

from types import MappingProxyType

import msgspec

from foretwin.contracts.vehicle import Parameter, VehicleParameters

_LENGTH, _FORCE = 1, 4
"""Powers of n; a force is mass n³ times acceleration n."""
POWERS = MappingProxyType(
    {
        **dict.fromkeys(
            (
                "wheelbase_m", "cog_from_rear_axle_m", "length_m", "width_m", "height_m",
                "rear_overhang_m", "friction", "max_drive_accel_mps2", "max_brake_decel_mps2",
            ),
            _LENGTH,
        ),
        "mass_kg": 3,
        "yaw_inertia_kgm2": 5,
        "front_cornering_stiffness_npr": _FORCE,
        "rear_cornering_stiffness_npr": _FORCE,
        "rolling_resistance_n": _FORCE,
        "drag_npv2": _FORCE - 2,
    }
)  # fmt: skip
"""By parameter; angles, ratios, gains, times and the height of the centre of gravity stay."""
ROAD_POWERS = MappingProxyType(
    {
        **{name: power for name, power in POWERS.items() if power != _FORCE},
        "cog_height_m": _LENGTH,
        "friction": 0,
        "max_drive_accel_mps2": 0,
        "max_brake_decel_mps2": 0,
        "front_cornering_stiffness_npr": 3,
        "rear_cornering_stiffness_npr": 3,
        "rolling_resistance_n": 3,
    }
)
"""The same for a road vehicle of the same build, whose forces grow as weights do: what is plausible
of a small car is plausible of that one."""


def in_world_size(vehicle: VehicleParameters, scale: float) -> VehicleParameters:
    """Return a small car with lengths `scale` times as large and the same times."""
    changes = {name: _times(scale**power, getattr(vehicle, name)) for name, power in POWERS.items()}
    return msgspec.structs.replace(vehicle, **changes)


def as_road_vehicle(name: str, value: float, scale: float) -> float:
    """Return a parameter of a small car as one of a road vehicle that is built alike."""
    return value * float(scale) ** ROAD_POWERS.get(name, 0)


def _times(factor: float, parameter: Parameter) -> Parameter:
    std = None if parameter.std is None else parameter.std * factor
    return Parameter(parameter.value * factor, std, parameter.source)
