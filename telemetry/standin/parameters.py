"""What the stand-in car is: read from standin.toml or a file like it."""

from __future__ import annotations

from pathlib import Path

import msgspec

from foretwin.contracts.sensor_drift import Drift
from foretwin.contracts.toml_file import load_toml

DEFAULT_FILE = Path(__file__).with_name("standin.toml")


class CarParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Actuators and resistances around the multi-body model."""

    steering_ratio: float
    """Angle of the steering wheel over that of the tyres."""
    steering_offset_rad: float
    steering_delay_s: float
    """Dead time from a steering command to the tyres."""
    steering_gain_ps: float
    """Tyre rate per error of the tyre angle."""
    drive_delay_s: float
    """Dead time from a drive or brake command to the force."""
    drive_gain: float
    """Achieved over commanded acceleration when driving."""
    brake_gain: float
    drag_npv2: float
    """Force over speed squared, N/(m/s)²."""
    rolling_resistance_n: float
    """Force that does not depend on speed."""
    steering_compliance_rad_per_mps2: float = 0.0
    """How far sideways acceleration turns the tyres back against the steering wheel: understeer, as
    from a column that gives or from softer tyres in front."""
    tyre_stiffness: float = 1.0
    """Cornering stiffness of all four tyres over CommonRoad's."""


class DriverParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How its own controller drives."""

    max_accel_mps2: float
    """The most with which it speeds up."""
    comfort_decel_mps2: float
    """With which it usually slows down."""
    max_decel_mps2: float
    """The most with which it slows down."""
    lateral_accel_mps2: float
    """To which it slows down in bends."""
    dwell_s: float
    """How long it stands where it has to stop."""
    preview_s: float
    """How far ahead it looks to steer."""
    plan_horizon_s: float
    """How far ahead it says its plan."""
    plan_step_s: float
    """Between the points of its plan."""


class SensorParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where its sensors are and how noisy: white noise as standard deviations, and drifts."""

    body_from_antenna_m: tuple[float, float, float]
    """From the rear axle's centre on the ground: forwards, left, up."""
    gnss_std_m: float
    """Of positions, along each axis."""
    gyro_std_radps: float
    """Of rates."""
    gyro_bias_radps: float
    """Added to the yaw rate."""
    accel_std_mps2: float
    """Of specific forces."""
    steering_wheel_std_rad: float
    """Of the angle of the steering wheel."""
    speed_std_mps: float
    """Of the wheel speed."""
    gnss_drift: Drift = Drift()
    """Of positions, along each axis, in m."""
    gyro_drift: Drift = Drift()
    """Of rates, in rad/s, beside the bias of the yaw rate."""
    accel_drift: Drift = Drift()
    """Of specific forces, in m/s²."""


class StandinParameters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The whole file."""

    car: CarParameters
    """What it is."""
    driver: DriverParameters
    """Who drives it."""
    sensors: SensorParameters
    """What it is measured by."""


def read_parameters(path: Path | None = None) -> StandinParameters:
    """Read a parameter file, by default the bundled one.

    Raises UserError naming the file and the field at fault, FileNotFoundError without a file.
    """
    file = path or DEFAULT_FILE
    return load_toml(file, "stand-in parameters").convert(StandinParameters)
