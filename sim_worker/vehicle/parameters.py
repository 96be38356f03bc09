"""Vehicle parameters from TOML, checked, with the derived numbers that several models need."""

from __future__ import annotations

import math
from pathlib import Path

from foretwin.contracts.errors import MissingFileError
from foretwin.contracts.toml_file import read_toml
from foretwin.contracts.vehicle import Parameter, VehicleFile, VehicleParameters
from foretwin.sim_worker.vehicle.plausible import PLAUSIBLE, check_plausible, is_plausible
from foretwin.sim_worker.vehicle.similarity import in_world_size

_FOLDER = Path(__file__).parent
DEFAULT_FILE = _FOLDER / "bmw_320i.toml"
GRAVITY_MPS2 = 9.81
MOST_SCALE = 100.0
"""As of an anchor."""


def bundled_vehicles() -> tuple[str, ...]:
    """Return the names of the vehicles that come along, for `load_vehicle`."""
    return tuple(sorted(file.stem for file in _FOLDER.glob("*.toml")))


def load_vehicle(path: Path | str | None = None) -> VehicleParameters:
    """Read the parameters of a bundled vehicle by its name, or of a file; None is the BMW 320i.

    A small car comes as large as it is in a World, by the `scale` of its file.

    Raises MissingFileError for neither a name nor a file and UserError, in one line with the file
    and the field, for anything that is no vehicle.
    """
    file = _read_file(path)
    fields = (name for name in VehicleParameters.__struct_fields__)
    vehicle = VehicleParameters(**{name: getattr(file, name) for name in fields})
    return vehicle if file.scale == 1.0 else in_world_size(vehicle, file.scale)


def scale_of(path: Path | str | None) -> float:
    """Return the `scale` in the file of a vehicle, 1 but for a small car; raises as `load_vehicle`
    does."""
    return _read_file(path).scale


def _read_file(path: Path | str | None) -> VehicleFile:
    source = DEFAULT_FILE if path is None else Path(path)
    if str(source) in bundled_vehicles():
        source = _FOLDER / f"{source}.toml"
    try:
        return read_toml(source, VehicleFile, what="vehicle", check=_check_file)
    except FileNotFoundError as error:
        names = ", ".join(bundled_vehicles())
        raise MissingFileError(f"{error}, and no bundled vehicle of that name: {names}") from error


def _check_file(file: VehicleFile) -> VehicleFile:
    if not 1.0 <= file.scale <= MOST_SCALE:
        raise ValueError(f"scale {file.scale:g}: 1, or of a small car up to {MOST_SCALE:g}")
    check_vehicle(file, scale=file.scale)
    return file


def check_vehicle(
    vehicle: VehicleParameters, *, scale: float = 1.0, before: VehicleParameters | None = None
) -> VehicleParameters:
    """Return `vehicle`, or raise ValueError naming the first field that no road vehicle has so.

    A small car, in its own size, is held against one `scale` times as large that is built alike.
    What was no road vehicle's `before` need not be one's now: a small car's grip in a World.
    """
    for name in PLAUSIBLE:
        parameter: Parameter = getattr(vehicle, name)
        if before is None or is_plausible(name, getattr(before, name).value):
            check_plausible(name, parameter.value, scale=scale)
        std = parameter.std
        if std is not None and not 0.0 <= std < math.inf:
            raise ValueError(f"{name} has the std {std:g}; it must be zero or more, and finite")
    if vehicle.cog_from_rear_axle_m.value >= vehicle.wheelbase_m.value:
        raise ValueError(
            f"cog_from_rear_axle_m {vehicle.cog_from_rear_axle_m.value} must be less than "
            f"wheelbase_m {vehicle.wheelbase_m.value}"
        )
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
