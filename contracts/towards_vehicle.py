"""What the orchestrator says towards a real vehicle; a gateway alone may pass it on, within bounds.

`sent_mono_ns` is the host's monotonic clock: orchestrator and gateway run on one host.
"""

from __future__ import annotations

import msgspec


class Authority(msgspec.Struct, frozen=True, kw_only=True):
    """The orchestrator's word that it is there and in charge; without it nothing goes out."""

    sent_mono_ns: int


class VehicleCommand(msgspec.Struct, frozen=True, kw_only=True):
    """What the vehicle shall do: angle at the tyres, positive to the left, acceleration, speed."""

    stamp_ns: int
    sent_mono_ns: int
    tire_angle_rad: float
    accel_mps2: float
    speed_mps: float
