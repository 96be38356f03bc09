"""What the orchestrator says towards a real vehicle; a gateway alone may pass it on, within bounds.

`sent_mono_ns` is the host's monotonic clock: who gives orders and the gateway run on one host.
"""

from __future__ import annotations

import msgspec


class Order(msgspec.Struct, frozen=True, kw_only=True):
    """What is obeyed only where it is signed; `foretwin.contracts.signing` does that."""

    number: int = 0
    """Goes up from one order to the next on the same channel."""
    signature: bytes = b""


class Authority(Order, frozen=True, kw_only=True):
    """The orchestrator's word that it is there and in charge; without it nothing goes out."""

    sent_mono_ns: int


class VehicleCommand(Order, frozen=True, kw_only=True):
    """What the vehicle shall do: angle at the tyres, positive to the left, acceleration, speed."""

    stamp_ns: int
    sent_mono_ns: int
    tire_angle_rad: float
    accel_mps2: float
    speed_mps: float


class OrderKeys(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Whose orders a gateway takes: the public halves (Ed25519, 32 bytes) of a run's keys."""

    authority: bytes
    vehicle_command: bytes
