"""One plan against what was then driven: how far apart in way and pace, and what that means."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.side_by_side import DisagreementKind
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths, kept_apart

_LEAST_WAY_M = 3.0
"""Ways are compared as far as both went, and not at all where that is less."""
_MOVED_M = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """From where on a plan and a drive disagree; a disagreement ends below `release` of that.

    Beside and faster or slower are set wide of what two careful drivers differ by: half the room
    that a car has in its lane, and what 4 s at 0.6 m/s² make.
    """

    beside_m: float = 1.0
    lane_m: float = 2.0
    turn_rad: float = radians(25.0)
    along_m: float = 5.0
    speed_mps: float = 2.5
    stands_mps: float = 0.5
    goes_mps: float = 2.0
    release: float = 0.6

    def lowered(self) -> Limits:
        """Return the limits below which a disagreement is over."""
        eased = ("beside_m", "along_m", "speed_mps", "goes_mps")
        return replace(self, **{name: self.release * getattr(self, name) for name in eased})


class Departure(NamedTuple):
    """A plan seen from what was driven, each where it is greatest in size, signed.

    `lateral_m` and `turned_rad` between the two ways wherever both led, None where one of them is
    too short to tell; `along_m` along the driven heading and `speed_mps` at the same instants;
    speeds at the end of both.
    """

    lateral_m: float | None
    turned_rad: float | None
    along_m: float
    speed_mps: float
    planned_end_mps: float
    driven_end_mps: float


def departure(planned: Array, driven: Array) -> Departure:
    """Compare x, y, yaw, speed (N, 4) of a plan and of the drive at the same N instants."""
    difference = planned - driven
    cos, sin = np.cos(driven[:, 2]), np.sin(driven[:, 2])
    lateral, turned = _between_ways(planned, driven)
    return Departure(
        lateral_m=lateral,
        turned_rad=turned,
        along_m=_greatest(cos * difference[:, 0] + sin * difference[:, 1]),
        speed_mps=_greatest(difference[:, 3]),
        planned_end_mps=float(planned[-1, 3]),
        driven_end_mps=float(driven[-1, 3]),
    )


def way_kind(found: Departure, limits: Limits) -> DisagreementKind | None:
    """Say what a departure means for the way, None where it is within the limits."""
    if found.lateral_m is None or found.turned_rad is None:
        return None
    aside_m = abs(found.lateral_m)
    if aside_m <= limits.beside_m:
        return None
    if abs(found.turned_rad) > limits.turn_rad:
        return "ads_turns_elsewhere"
    return "ads_in_another_lane" if aside_m > limits.lane_m else "ads_beside"


def pace_kind(found: Departure, limits: Limits) -> DisagreementKind | None:
    """Say what a departure means for the pace, None where it is within the limits."""
    planned, driven = found.planned_end_mps, found.driven_end_mps
    if planned < limits.stands_mps and driven > limits.goes_mps:
        return "ads_stops"
    if driven < limits.stands_mps and planned > limits.goes_mps:
        return "human_stops"
    if abs(found.speed_mps) > limits.speed_mps:
        return "ads_faster" if found.speed_mps > 0.0 else "ads_slower"
    if abs(found.along_m) > limits.along_m:
        return "ads_faster" if found.along_m > 0.0 else "ads_slower"
    return None


def _between_ways(planned: Array, driven: Array) -> tuple[float, float] | tuple[None, None]:
    """Return the greatest offset and angle of the planned way from the driven, as far as both go.

    None where one of them stands or hardly moves. Ways, not instants: a stop on a lane's middle
    departs in pace, not in way.
    """
    moved = _moved(driven)
    if len(moved) < 2 or len(_moved(planned)) < 2:
        return None, None
    way = FrenetPath(moved[:, :2], before_m=0.0)
    gone_m = arc_lengths(planned[:, :2])
    if min(way.length_m, float(gone_m[-1])) < _LEAST_WAY_M:
        return None, None
    place = way.locate(planned[:, :2])
    common = (place.arc_m < way.length_m) & (gone_m <= way.length_m)
    if not common.any():
        return None, None
    turned = wrap_angle(planned[common, 2] - way.yaw_at(place.arc_m[common]))
    return _greatest(place.offset_m[common]), _greatest(np.asarray(turned))


def _moved(track: Array) -> Array:
    """Return the rows of a track (N, 4) that lie apart from those before."""
    return track[kept_apart(track[:, :2], least_m=_MOVED_M)]


def _greatest(values: Array) -> float:
    return float(values[np.abs(values).argmax()])
