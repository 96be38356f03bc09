"""Which virtual road users a car would report beside those that it really sees, and which not.

Real ones win: a virtual one that coincides with a real one is that one. A virtual one is reported
only where a sensor on the car would see it past real and virtual bodies. What is really there is
never left out, unless `hide_real` asks for it: a stack that does not know of a real body drives
into it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.drive import RoadUser, RoadUserKind, VehicleState
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw, local_pose
from foretwin.geometry.rectangles import Rectangles, depth_within
from foretwin.telemetry.mixed.occlusion import Viewpoint, seen_shares

COINCIDES_M = 0.5
"""A virtual road user whose centre lies within a real one's outline widened by so much may be it;
chosen as what good trackers are wrong by."""
ALIKE_SIZE = 2.0
"""Nor may one be longer, or wider, than so many times the other."""
_FAMILY: dict[RoadUserKind, int] = {
    "pedestrian": 1, "bicycle": 2, "motorcycle": 2, "car": 3, "van": 3, "lorry": 3, "bus": 3,
    "tram": 3,
}  # fmt: skip
"""Kinds that perception takes for one another; what is unknown may be anything."""


class MergeRules(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """As seen by which sensor virtual road users are reported, and how sure the car is of them."""

    range_m: float = 80.0
    """How far the sensor sees; chosen as what object lists of roof lidars reach."""
    field_of_view_deg: float = 360.0
    """All round, or so much to both sides of straight ahead together."""
    sensor_m: tuple[float, float] = (0.0, 0.0)
    """Its place in base_link: forward, left."""
    least_seen: float = 0.3
    """So much of a body's apparent width must be seen; chosen: a third of a walker is one leg."""
    hide_real: bool = False
    """Whether virtual bodies hide real ones: on closed ground alone, what it hides is there."""
    position_std_m: float = 0.1
    """Standard deviation that is told of virtual positions; 0 is told as exact."""
    yaw_std_rad: float = 0.05
    """Standard deviation that is told of their yaws."""
    speed_std_mps: float = 0.2
    """Standard deviation that is told of their speeds."""

    def validate(self) -> None:
        """Raise ValueError naming the key at fault."""
        if not 0.0 < self.range_m <= 1000.0:
            raise ValueError(f"range_m {self.range_m}: above 0, at most 1000")
        if not 0.0 < self.field_of_view_deg <= 360.0:
            raise ValueError(f"field_of_view_deg {self.field_of_view_deg}: above 0, at most 360")
        if not all(abs(place) <= 20.0 for place in self.sensor_m):
            raise ValueError(f"sensor_m {self.sensor_m}: forward and left, within 20 m")
        if not 0.0 < self.least_seen <= 1.0:
            raise ValueError(f"least_seen {self.least_seen}: above 0, at most 1")
        for name in ("position_std_m", "yaw_std_rad", "speed_std_mps"):
            if not 0.0 <= getattr(self, name) <= 100.0:
                raise ValueError(f"{name} {getattr(self, name)}: 0 to 100")


class Merged(NamedTuple):
    """What of two lists is reported together; the virtual ones left out by why."""

    virtual: tuple[RoadUser, ...]
    hidden_real: frozenset[int]
    """Places in the real list of those that virtual bodies hide; none unless that is asked for."""
    coincide: int
    """Virtual ones that are real ones."""
    not_seen: int
    """Virtual ones out of range, out of the field of view, or behind others."""


def viewpoint(
    state: VehicleState, frame: LocalFrame, rules: MergeRules, *, stamp_ns: int
) -> Viewpoint:
    """Return where the sensor is at a stamp near that of the state, in the plane of `frame`."""
    later_s = (stamp_ns - state.stamp_ns) * 1e-9
    x_m, y_m, yaw_rad = local_pose(frame, state.position, state.yaw_rad)
    yaw_rad += state.yaw_rate_radps * later_s
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    ahead_m, left_m = rules.sensor_m[0] + state.speed_mps * later_s, rules.sensor_m[1]
    return Viewpoint(
        x_m + cos * ahead_m - sin * left_m,
        y_m + sin * ahead_m + cos * left_m,
        yaw_rad,
        math.radians(rules.field_of_view_deg),
        rules.range_m,
    )


def merge(
    real: Sequence[RoadUser],
    virtual: Sequence[RoadUser],
    view: Viewpoint,
    rules: MergeRules,
    frame: LocalFrame,
) -> Merged:
    """Return which of the road users, all at one instant, are reported together."""
    ours = _apart(real, virtual, frame)
    if not ours:
        return Merged((), frozenset(), len(virtual), 0)
    bodies = rectangles_of([*real, *ours], frame)
    is_ours = np.arange(len(bodies.yaw_rad)) >= len(real)
    seen = (
        seen_shares(view, bodies, np.broadcast_to(is_ours[:, None], (len(is_ours),) * 2))[is_ours]
        >= rules.least_seen
    )
    hidden: frozenset[int] = frozenset()
    if rules.hide_real:
        # Where its own sensors reach the car has said itself.
        everywhere = view._replace(field_of_view_rad=math.tau, range_m=math.inf)
        shares = seen_shares(everywhere, bodies, ~is_ours[:, None] & is_ours)[~is_ours]
        hidden = frozenset(np.flatnonzero(shares < rules.least_seen).tolist())
    reported = tuple(user for user, is_seen in zip(ours, seen, strict=True) if is_seen)
    return Merged(reported, hidden, len(virtual) - len(ours), len(ours) - len(reported))


def rectangles_of(users: Sequence[RoadUser], frame: LocalFrame) -> Rectangles:
    """Return the outlines of N road users in the plane of `frame`."""
    lat = np.array([user.position.lat_deg for user in users])
    lon = np.array([user.position.lon_deg for user in users])
    yaw = np.array([user.yaw_rad for user in users])
    return Rectangles(
        np.asarray(local_from_geo(frame, lat, lon)).reshape(-1, 2),
        np.asarray(local_from_geo_yaw(frame, yaw, lat, lon)),
        np.array([user.length_m for user in users]),
        np.array([user.width_m for user in users]),
    )


def _apart(
    real: Sequence[RoadUser], virtual: Sequence[RoadUser], frame: LocalFrame
) -> list[RoadUser]:
    """Return the virtual road users that are none of the real ones; each real one is one at most,
    the nearest first."""
    if not real or not virtual:
        return list(virtual)
    theirs, ours = rectangles_of(real, frame), rectangles_of(virtual, frame)
    # (V, R): how deep the middle of each virtual one lies in each real one.
    depth_m = depth_within(ours.centre_m, theirs).T
    away_m = np.linalg.norm(ours.centre_m[:, None] - theirs.centre_m[None], axis=-1)
    may_be = (depth_m >= -COINCIDES_M) & _alike(real, theirs, virtual, ours)
    taken: dict[int, int] = {}
    pairs = np.argwhere(may_be)
    for v, r in pairs[np.argsort(away_m[may_be], kind="stable")].tolist():
        if v not in taken and r not in taken.values():
            taken[v] = r
    return [user for v, user in enumerate(virtual) if v not in taken]


def _alike(
    real: Sequence[RoadUser], theirs: Rectangles, virtual: Sequence[RoadUser], ours: Rectangles
) -> Flags:
    """Return (V, R) whether two road users may be one by their kinds and sizes."""
    kinds_r = np.array([_FAMILY.get(user.kind, 0) for user in real])
    kinds_v = np.array([_FAMILY.get(user.kind, 0) for user in virtual])[:, None]
    alike = (kinds_r == kinds_v) | (kinds_r == 0) | (kinds_v == 0)
    sizes: tuple[tuple[Array, Array], ...] = (
        (np.asarray(ours.length_m), np.asarray(theirs.length_m)),
        (np.asarray(ours.width_m), np.asarray(theirs.width_m)),
    )
    for mine, other in sizes:
        ratio = mine[:, None] / other
        alike &= (ratio <= ALIKE_SIZE) & (ratio >= 1.0 / ALIKE_SIZE)
    return np.asarray(alike)
