"""What the driving software (ADS) planned beside what was driven, and where the two disagree."""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.drive import ControlMode
from foretwin.contracts.frames import GeoPoint

Aspect = Literal["way", "pace"]
WayDisagreement = Literal["ads_turns_elsewhere", "ads_in_another_lane", "ads_beside"]
PaceDisagreement = Literal["ads_stops", "human_stops", "ads_faster", "ads_slower"]
DisagreementKind = Literal[WayDisagreement, PaceDisagreement]
"""In each aspect the gravest comes first."""


class Disagreement(msgspec.Struct, frozen=True, kw_only=True):
    """A stretch on which the ADS kept planning otherwise than the human then drove.

    `stamp_ns` is that of the first plan that was departed from, `position` where the car was then,
    `junction_id` the junction it was at or had before it, `route_m` how far along its route. The
    figures are the greatest in size, ADS minus human: `lateral_m` of the ways, positive left, None
    where none could be compared; `along_m` and `speed_mps` at the same instants.
    """

    vehicle_id: str
    segment: int
    """Which segment between takeovers, from 0."""
    aspect: Aspect
    kind: DisagreementKind
    stamp_ns: int
    end_stamp_ns: int
    over: bool
    """False while it lasts."""
    position: GeoPoint
    junction_id: str | None
    route_m: float | None
    lateral_m: float | None
    along_m: float
    speed_mps: float


class DrivenSegment(msgspec.Struct, frozen=True, kw_only=True):
    """A stretch between two takeovers, and how far plans lay from what was then driven in it.

    The figures are 95th percentiles of each plan's greatest size, None where no plan was compared:
    `lateral_m` of the plans whose way could be, `ways` of them; it cannot where the car or its plan
    stands or hardly moves. `cut` plans were compared as far as the next takeover, `too_short` ones
    not at all.
    """

    number: int
    control_mode: ControlMode
    from_stamp_ns: int
    to_stamp_ns: int
    plans: int
    ways: int
    cut: int
    too_short: int
    lateral_m: float | None
    along_m: float | None
    speed_mps: float | None
    disagreements: int
