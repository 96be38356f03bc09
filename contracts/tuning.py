"""The vehicle's parameters during a drive: what was identified, set by hand, pinned, rolled back.

Names of parameters are the fields of `VehicleParameters`, in its units, besides the derived
`understeer_gradient_rad_per_mps2` (0.5 is 0.5 rad per m/s² of lateral acceleration).
"""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.gap import GapAlarm, GapSample, Verdict
from foretwin.contracts.vehicle import VehicleParameters

UNDERSTEER_GRADIENT = "understeer_gradient_rad_per_mps2"
ParameterOrigin = Literal["file", "identified", "set", "rolled_back"]


class ParameterEstimate(msgspec.Struct, frozen=True, kw_only=True):
    """What a stretch of driving says of one parameter: a value and its 95 % interval.

    `value`, `low` and `high` are None where the stretch says nothing; `reason` then tells why, and
    otherwise, where the interval is wide, what it would take to narrow it.
    """

    name: str
    value: float | None
    low: float | None
    high: float | None
    prior: float | None = None
    """The value that was in force."""
    reason: str = ""


class SteeringMapBin(msgspec.Struct, frozen=True, kw_only=True):
    """Steering between two speeds: steering-wheel over effective tyre angle, with its interval."""

    from_mps: float
    to_mps: float
    ratio: float
    low: float
    high: float
    samples: int


class Identification(msgspec.Struct, frozen=True, kw_only=True):
    """What the driving between two stamps says of the vehicle."""

    vehicle_id: str
    from_stamp_ns: int
    stamp_ns: int
    estimates: tuple[ParameterEstimate, ...]
    steering_map: tuple[SteeringMapBin, ...] = ()
    excited_s: float = 0.0
    """Seconds in which the car turned, sped up or braked enough to tell anything."""
    step_noticed: str = ""
    """In words: a parameter that jumped, such as a tyre's stiffness after a change of tyres."""


class ParameterChange(msgspec.Struct, frozen=True, kw_only=True):
    """One parameter that counts from `stamp_ns` on, for logs and those who watch."""

    vehicle_id: str
    stamp_ns: int
    name: str
    before: float
    value: float
    std: float | None
    origin: ParameterOrigin
    pinned: bool = False


class UseVehicle(msgspec.Struct, frozen=True, kw_only=True):
    """Tells a worker which parameters count from `stamp_ns` on; its reply is the same message."""

    stamp_ns: int
    vehicle: VehicleParameters
    version: int
    """Counts the sets of parameters of a run; jobs say with which they were simulated."""
    changes: tuple[ParameterChange, ...] = ()
    """Against the version before; for a process that has just come up, all that a hand has set."""
    pinned: tuple[str, ...] = ()
    """Parameters that stay as they are, whatever is identified."""


class TuneRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Lock step: weigh everything sent so far, samples by channel and states, then reply."""

    published: dict[str, int]
    states: int


class TuneReply(msgspec.Struct, frozen=True, kw_only=True):
    """Lock step: what follows from everything sent so far, each kind in time order."""

    identifications: tuple[Identification, ...] = ()
    gaps: tuple[GapSample, ...] = ()
    alarms: tuple[GapAlarm, ...] = ()
    verdicts: tuple[Verdict, ...] = ()


class SetRequest(msgspec.Struct, frozen=True, kw_only=True):
    """`foretwin set KEY=VALUE`: a parameter, a role or a switch of a running drive.

    Keys: `vehicle.NAME` with a number, `pin`, `unpin` or `rollback`; `role.VEHICLE_ID` with twin,
    shadow or ghost; `correction` with free or follow.
    """

    key: str
    value: str


class SetReply(msgspec.Struct, frozen=True, kw_only=True):
    """Whether it was done, and in one line what counts now or why not."""

    done: bool
    text: str
