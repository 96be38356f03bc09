"""What a road vehicle's parameters may be: beyond it, a number is a mistake or a misfit."""

from __future__ import annotations

from foretwin.sim_worker.vehicle.similarity import as_road_vehicle

PLAUSIBLE: dict[str, tuple[float, float]] = {
    "mass_kg": (150.0, 60_000.0),
    "yaw_inertia_kgm2": (50.0, 1_000_000.0),
    "wheelbase_m": (0.8, 12.0),
    "cog_from_rear_axle_m": (0.1, 10.0),
    "cog_height_m": (0.1, 3.0),
    "front_cornering_stiffness_npr": (2_000.0, 3_000_000.0),
    "rear_cornering_stiffness_npr": (2_000.0, 3_000_000.0),
    "friction": (0.05, 2.0),
    "steering_ratio": (1.0, 40.0),
    "steering_offset_rad": (-0.2, 0.2),
    "steering_delay_s": (0.0, 0.6),
    "max_tire_angle_rad": (0.1, 1.5),
    "max_tire_rate_radps": (0.05, 10.0),
    "drag_npv2": (0.0, 10.0),
    "rolling_resistance_n": (0.0, 10_000.0),
    "drive_gain": (0.2, 3.0),
    "brake_gain": (0.2, 3.0),
    "drive_lag_s": (0.0, 2.0),
    "brake_lag_s": (0.0, 2.0),
    "accel_delay_s": (0.0, 1.0),
    "steering_lag_s": (0.0, 2.0),
    "max_drive_accel_mps2": (0.2, 20.0),
    "max_brake_decel_mps2": (1.0, 20.0),
    "wheel_inertia_mass_factor": (1.0, 2.0),
    "length_m": (1.0, 30.0),
    "width_m": (0.4, 4.0),
    "height_m": (0.4, 5.0),
    "rear_overhang_m": (0.0, 6.0),
}
"""Least and most of every parameter by name, from a city scooter to a loaded articulated lorry.

Futures add up to 0.4 s to the delay of the steering, and its buffer of samples holds 1 s.
"""


def is_plausible(name: str, value: float) -> bool:
    """Whether a road vehicle may have a parameter so."""
    low, high = PLAUSIBLE[name]
    return low <= value <= high


def check_plausible(name: str, value: float, *, scale: float = 1.0) -> float:
    """Return `value`; raises ValueError, with what would be right, for one that no vehicle has.

    That of a small car counts as that of a road vehicle `scale` times as large that is built alike.
    """
    low, high = (end / as_road_vehicle(name, 1.0, scale) for end in PLAUSIBLE[name])
    if not low <= value <= high:
        raise ValueError(f"{name} {value:g} is implausible; it must be {low:g} to {high:g}")
    return value
