"""What the stand-in car is: read from standin.toml or a file like it."""

from __future__ import annotations

from pathlib import Path

import msgspec

from foretwin.contracts.toml_file import load_toml

DEFAULT_FILE = Path(__file__).with_name("standin.toml")


class CarParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Actuators and resistances around the multi-body model."""

    steering_ratio: float
    steering_offset_rad: float
    steering_delay_s: float
    steering_gain_ps: float
    drive_delay_s: float
    drive_gain: float
    brake_gain: float
    drag_npv2: float
    rolling_resistance_n: float
    steering_compliance_rad_per_mps2: float = 0.0
    """How far sideways acceleration turns the tyres back against the steering wheel: understeer, as
    from a column that gives or from softer tyres in front."""
    tyre_stiffness: float = 1.0
    """Cornering stiffness of all four tyres over CommonRoad's."""


class DriverParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How its own controller drives."""

    max_accel_mps2: float
    comfort_decel_mps2: float
    max_decel_mps2: float
    lateral_accel_mps2: float
    dwell_s: float
    preview_s: float
    plan_horizon_s: float
    plan_step_s: float


class SensorParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where its sensors are and how noisy; standard deviations of white noise."""

    body_from_antenna_m: tuple[float, float, float]
    gnss_std_m: float
    gyro_std_radps: float
    gyro_bias_radps: float
    accel_std_mps2: float
    steering_wheel_std_rad: float
    speed_std_mps: float


class StandinParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The whole file."""

    car: CarParameters
    driver: DriverParameters
    sensors: SensorParameters


def read_parameters(path: Path | None = None) -> StandinParameters:
    """Read a parameter file, by default the bundled one.

    Raises UserError naming the file and the field at fault, FileNotFoundError without a file.
    """
    file = path or DEFAULT_FILE
    return load_toml(file, "stand-in parameters").convert(StandinParameters)
