"""Units a declaration may name, each with the factor into the project's unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import Decimal

import numpy as np

from foretwin.contracts.arrays import Array

LENGTH = {"m": 1.0, "km": 1000.0, "ft": 0.3048, "cm": 0.01, "mm": 0.001}
"""Into metres."""

SPEED = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704, "kn": 1852.0 / 3600.0, "ft/s": 0.3048,
         "cm/s": 0.01, "mm/s": 0.001}  # fmt: skip
"""Into m/s."""

STANDARD_GRAVITY_MPS2 = 9.80665
"""By definition: 3rd CGPM (1901), ISO 80000-3."""
ACCELERATION = {"m/s2": 1.0, "m/s²": 1.0, "g": STANDARD_GRAVITY_MPS2}
"""Into m/s²; g is the standard gravity."""

ANGLE = {"rad": 1.0, "deg": math.pi / 180.0}
"""Into radians."""

GEOGRAPHIC_ANGLE = {"deg": 1.0, "rad": 180.0 / math.pi, "1e-7 deg": 1e-7, "1e-6 deg": 1e-6,
                    "1e-5 deg": 1e-5, "mas": 1.0 / 3.6e6, "arcmin": 1.0 / 60.0,
                    "ddmm": math.nan}  # fmt: skip
"""Into degrees, for latitude and longitude (mas are thousandths of a second of arc); of DDMM no
factor does, see degrees_of."""
DDMM = "ddmm"
"""Degrees times a hundred and minutes, as NMEA writes them: 5230.6 are 52° 30.6'."""


def degrees_of(values: Array, unit: str) -> Array:
    """Return angles (N,) on the ellipsoid in degrees; NaN where a DDMM has 60 minutes or more."""
    if unit != DDMM:
        return values * GEOGRAPHIC_ANGLE[unit]
    size = np.abs(values)
    minutes = size % 100.0
    whole = np.floor(size / 100.0) + minutes / 60.0
    return np.asarray(np.where(minutes < 60.0, np.sign(values) * whole, np.nan))


ANGULAR_RATE = {"rad/s": 1.0, "deg/s": math.pi / 180.0}
"""Into rad/s."""

TIME_NS = {"s": Decimal(10**9), "ms": Decimal(10**6), "us": Decimal(1000), "ns": Decimal(1)}
"""Into nanoseconds; decimal, since 19 digits do not fit a float."""

ISO_TIME = "iso8601"
"""The time unit of dates such as 2026-03-01T10:00:00Z."""

BY_FIELD: dict[str, Mapping[str, float]] = {
    **dict.fromkeys(("latitude", "longitude"), GEOGRAPHIC_ANGLE),
    **dict.fromkeys(("easting", "northing", "x", "y", "z", "altitude", "std"), LENGTH),
    **dict.fromkeys(("forward", "east", "north"), SPEED),
    **dict.fromkeys(("accel", "accel_x", "accel_y", "accel_z"), ACCELERATION),
    **dict.fromkeys(("rate_x", "rate_y", "rate_z", "yaw_rate"), ANGULAR_RATE),
    **dict.fromkeys(("yaw", "wheel", "tire"), ANGLE),
}
"""Units of a declaration's fields, the project's own first, with the factor into it."""
