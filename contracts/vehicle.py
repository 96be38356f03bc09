"""Parameters of a vehicle: each a value with a standard deviation and where it came from."""

from __future__ import annotations

import msgspec

from foretwin.contracts.drive import RoadUserKind

_VAN_M, _LORRY_M = 5.2, 7.0


class Parameter(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One number with its uncertainty (one standard deviation, None where unknown) and source."""

    value: float
    """In the unit that ends the name."""
    std: float | None = None
    """One standard deviation; left out where nobody knows."""
    source: str = "default"
    """Where the number comes from."""


class VehicleParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a planar vehicle model needs, in SI units, with base_link at the rear-axle centre.

    Cornering stiffnesses are per axle. `steering_ratio` is steering wheel over tyre angle,
    `steering_offset_rad` is added at the tyre. Delays are from command to actuator, lags those of
    the actuator itself; a file without them means none.
    """

    name: str
    """What the vehicle is called."""
    mass_kg: Parameter
    """With driver and load."""
    yaw_inertia_kgm2: Parameter
    """About the vertical axis through the centre of gravity."""
    wheelbase_m: Parameter
    """Between the axles."""
    cog_from_rear_axle_m: Parameter
    """How far before the rear axle the centre of gravity lies."""
    cog_height_m: Parameter
    """Of the centre of gravity above the ground."""
    front_cornering_stiffness_npr: Parameter
    """Side force per slip angle of both front tyres together."""
    rear_cornering_stiffness_npr: Parameter
    """Side force per slip angle of both rear tyres together."""
    friction: Parameter
    """Between tyres and a dry road, 1 for gravity."""
    steering_ratio: Parameter
    """Angle of the steering wheel over that of the tyres."""
    steering_offset_rad: Parameter
    steering_delay_s: Parameter
    """Dead time from a steering command to the tyres."""
    max_tire_angle_rad: Parameter
    """As far as the tyres turn to either side."""
    max_tire_rate_radps: Parameter
    """As fast as they turn."""
    drag_npv2: Parameter
    """Force over speed squared, N/(m/s)²."""
    rolling_resistance_n: Parameter
    """Force that does not depend on speed."""
    drive_gain: Parameter
    """Achieved over commanded acceleration when driving."""
    brake_gain: Parameter
    """Achieved over commanded deceleration when braking."""
    drive_lag_s: Parameter = Parameter(0.0)
    """Time constant with which the drive force follows its command."""
    brake_lag_s: Parameter = Parameter(0.0)
    """Time constant with which the brake force follows its command."""
    accel_delay_s: Parameter = Parameter(0.0)
    """Dead time before drive and brake begin to follow."""
    steering_lag_s: Parameter = Parameter(0.0)
    """Time constant with which the tyre angle follows its command, after `steering_delay_s`."""
    max_drive_accel_mps2: Parameter
    """The most that the drive can do."""
    max_brake_decel_mps2: Parameter
    """The most that the brakes can do on a dry road."""
    wheel_inertia_mass_factor: Parameter
    """Effective over real mass along the road, for the wheels' spin inertia."""
    length_m: Parameter
    """From bumper to bumper."""
    width_m: Parameter
    """Without mirrors."""
    height_m: Parameter
    """Above the ground."""
    rear_overhang_m: Parameter
    """From the rear bumper to the rear axle."""


class VehicleFile(VehicleParameters, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A vehicle as its file holds it; a small car in its own size."""

    scale: float = 1.0
    """So many times as large it drives in a World: 10 for a car of 1:10; its anchor's scale."""


def kind_by_length(length_m: float) -> RoadUserKind:
    """Return what others take a vehicle of this length for."""
    if length_m <= _VAN_M:
        return "car"
    return "van" if length_m < _LORRY_M else "lorry"
