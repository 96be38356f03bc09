"""What the orchestrator says towards a real vehicle; a gateway alone may pass it on, within bounds,
and says whether it does.

`sent_mono_ns` is the host's monotonic clock: who gives orders and the gateway run on one host.
"""

from __future__ import annotations

from typing import Literal

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


GateState = Literal["off", "waiting", "open", "shut"]
"""A switch is missing; not yet; what is virtual goes to the vehicle; nothing any more, for good."""
GateReason = Literal[
    "well",
    "switched off",
    "no word yet",
    "word overdue",
    "link down",
    "command not finite",
    "state stale",
    "car not heard",
    "positions overdue",
    "position apart",
    "outside the fence",
    "near the fence",
]
"""Why the gate is as it is; `well` where nothing keeps it shut."""


class Injection(msgspec.Struct, frozen=True, kw_only=True):
    """Whether a car on a lot is shown what is virtual, as its gateway says; lengths of the lot.

    `stamp_ns` is the vehicle's time: its newest state's, and what has passed since.
    """

    stamp_ns: int
    gate: GateState
    reason: GateReason
    fence_m: float
    """From the car's body to the nearest side of the fence, negative where it does not fit in."""
    margin_m: float
    """So much is needed at its speed."""
