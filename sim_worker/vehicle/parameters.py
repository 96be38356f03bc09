"""Vehicle parameters from TOML, checked, with the derived numbers that several models need."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from foretwin.contracts.errors import MissingFileError
from foretwin.contracts.toml_file import read_toml
from foretwin.contracts.vehicle import Parameter, VehicleParameters

_FOLDER = Path(__file__).parent
DEFAULT_FILE = _FOLDER / "bmw_320i.toml"
GRAVITY_MPS2 = 9.81
MAX_VEHICLE_DELAY_S = 0.6
"""Futures add up to 0.4 s, and the sample buffer of the steering actuator holds 1 s."""

MAX_FORCE_DELAY_S = 1.0
"""Longer delays are no actuator's dead time."""

_RESISTANCES = ("drag_npv2", "rolling_resistance_n")
_LAGS = ("steering_delay_s", "drive_lag_s", "brake_lag_s", "accel_delay_s", "steering_lag_s")
_MAY_BE_ZERO = {*_RESISTANCES, *_LAGS, "rear_overhang_m"}
_ANY_SIGN = {"steering_offset_rad"}


def bundled_vehicles() -> tuple[str, ...]:
    """Return the names of the vehicles that come along, for `load_vehicle`."""
    return tuple(sorted(file.stem for file in _FOLDER.glob("*.toml")))


def load_vehicle(path: Path | str | None = None) -> VehicleParameters:
    """Read the parameters of a bundled vehicle by its name, or of a file; None is the BMW 320i.

    Raises MissingFileError for neither a name nor a file and UserError, in one line with the file
    and the field, for anything that is no vehicle.
    """
    source = DEFAULT_FILE if path is None else Path(path)
    if str(source) in bundled_vehicles():
        source = _FOLDER / f"{source}.toml"
    try:
        return read_toml(source, VehicleParameters, what="vehicle", check=check_vehicle)
    except FileNotFoundError as error:
        names = ", ".join(bundled_vehicles())
        raise MissingFileError(f"{error}, and no bundled vehicle of that name: {names}") from error


def check_vehicle(vehicle: VehicleParameters) -> VehicleParameters:
    """Return `vehicle`, or raise ValueError naming the first field that is out of range."""
    for field in msgspec.structs.fields(vehicle):
        parameter = getattr(vehicle, field.name)
        if not isinstance(parameter, Parameter):
            continue
        value = parameter.value
        if not math.isfinite(value):
            raise ValueError(f"{field.name} is {value}; it must be a finite number")
        if field.name in _ANY_SIGN:
            continue
        if value < 0.0 or (value == 0.0 and field.name not in _MAY_BE_ZERO):
            least = "zero or more" if field.name in _MAY_BE_ZERO else "more than zero"
            raise ValueError(f"{field.name} is {value}; it must be {least}")
    if vehicle.cog_from_rear_axle_m.value >= vehicle.wheelbase_m.value:
        raise ValueError(
            f"cog_from_rear_axle_m {vehicle.cog_from_rear_axle_m.value} must be less than "
            f"wheelbase_m {vehicle.wheelbase_m.value}"
        )
    if vehicle.steering_delay_s.value > MAX_VEHICLE_DELAY_S:
        raise ValueError(
            f"steering_delay_s {vehicle.steering_delay_s.value} must be at most "
            f"{MAX_VEHICLE_DELAY_S}: futures add to it"
        )
    if vehicle.accel_delay_s.value > MAX_FORCE_DELAY_S:
        raise ValueError(
            f"accel_delay_s {vehicle.accel_delay_s.value} must be at most {MAX_FORCE_DELAY_S}"
        )
    if vehicle.max_tire_angle_rad.value >= math.pi / 2:
        raise ValueError(f"max_tire_angle_rad {vehicle.max_tire_angle_rad.value} must be below π/2")
    return vehicle


def understeer_gradient(vehicle: VehicleParameters) -> float:
    """Return K in rad per m/s², with tyre angle δ = L/R + K·a_y (Gillespie 1992, eq. 6-15)."""
    wheelbase = vehicle.wheelbase_m.value
    rear = vehicle.cog_from_rear_axle_m.value
    return (
        vehicle.mass_kg.value
        / wheelbase
        * (
            rear / vehicle.front_cornering_stiffness_npr.value
            - (wheelbase - rear) / vehicle.rear_cornering_stiffness_npr.value
        )
    )
