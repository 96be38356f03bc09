"""Units a declaration may name, each with the factor into the project's unit."""

from __future__ import annotations

import math
from decimal import Decimal

LENGTH = {"m": 1.0, "km": 1000.0, "ft": 0.3048}
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

GEOGRAPHIC_ANGLE = {"deg": 1.0, "rad": 180.0 / math.pi, "1e-7 deg": 1e-7}
"""Into degrees, for latitude and longitude."""

ANGULAR_RATE = {"rad/s": 1.0, "deg/s": math.pi / 180.0}
"""Into rad/s."""

TIME_NS = {"s": Decimal(10**9), "ms": Decimal(10**6), "us": Decimal(1000), "ns": Decimal(1)}
"""Into nanoseconds; decimal, since 19 digits do not fit a float."""

ISO_TIME = "iso8601"
"""The time unit of dates such as 2026-03-01T10:00:00Z."""
