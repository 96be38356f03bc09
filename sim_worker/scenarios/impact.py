"""Where two road users must be so that the ego's front touches the other at a planned point.

Neither slows down nor swerves: both follow their paths at their speeds. The point of the front
that is to be hit draws a curve along the ego's path, each point of the other's outline one along
the other's; where two such curves cross, the two points can meet. Of all such meetings those
count before which the boxes touch nowhere else, which a simulation in closed form tells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker.vehicle.road_user_kinds import KindTraits

TOLERANCE_M = 0.08
"""How far from its plan the first touch may be, in place and from the front's point."""
_SPACING_M = 0.25
_TICK_S, _EARLY_TICK_S = 0.02, 0.1
_FINE_FOR_S = 0.6
"""Ticks are fine just before the end of a search: there, boxes come near each other."""
_AFTER_S = 0.06
_BISECTIONS = 9
_CLEAR_M = 0.1
"""Boxes that come so near are taken to touch where nothing may."""
_PRESS_S, _BRUSH_M = 0.1, 0.04
"""So soon after the touch boxes overlap by more than half of this, or they merely brush."""
_OUTLINE = np.array([
    (0.25, 0.5), (0.25, -0.5), (0.0, 0.5), (0.0, -0.5), (0.5, 0.5), (0.5, -0.5), (0.5, 0.0),
    (0.5, 0.25), (0.5, -0.25), (-0.25, 0.5), (-0.25, -0.5), (-0.5, 0.5), (-0.5, -0.5),
    (-0.5, 0.0),
])  # fmt: skip
"""Points of the other's outline in its length and width, the likeliest to be hit first."""


class EgoBox(NamedTuple):
    """The ego's box along its path: from base_link to its leading end and to its centre."""

    length_m: float
    width_m: float
    front_m: float
    centre_m: float


class Moving(NamedTuple):
    """A box that keeps its speed along a path, `offset_m` to the left of it, until it brakes."""

    path: FrenetPath
    speed_mps: float
    offset_m: float = 0.0
    brakes_after_s: float = float("inf")
    decel_mps2: float = 0.0

    def travelled_m(self, time_s: Array) -> Array:
        """Return how far it has come after (…) seconds."""
        if np.isinf(self.brakes_after_s) or self.decel_mps2 <= 0.0:
            return self.speed_mps * time_s
        braking = np.clip(time_s - self.brakes_after_s, 0.0, self.speed_mps / self.decel_mps2)
        steady = np.minimum(time_s, self.brakes_after_s)
        return np.asarray(self.speed_mps * (steady + braking) - self.decel_mps2 * braking**2 / 2.0)


class Span(NamedTuple):
    """A stretch of a path between two arc lengths."""

    from_m: float
    to_m: float


class Impact(NamedTuple):
    """The planned first touch: arc lengths of base_link and of the other's centre, and where."""

    ego_arc_m: float
    actor_arc_m: float
    point_m: Array
    share: float


class Touch(NamedTuple):
    """The first touch of C pairs of boxes: `time_s` (C,) from the start, infinite where none.

    Arc lengths (C,) are those at the touch, or else at the end of the search.
    """

    time_s: Array
    ego_arc_m: Array
    actor_arc_m: Array


def ego_box(vehicle: VehicleParameters, *, reverse: bool = False) -> EgoBox:
    """Return the ego's box; in reverse its rear leads."""
    length, rear = vehicle.length_m.value, vehicle.rear_overhang_m.value
    front, centre = length - rear, length / 2.0 - rear
    if reverse:
        front, centre = rear, -centre
    return EgoBox(length, vehicle.width_m.value, front, centre)


def front_point(ego: Moving, box: EgoBox, arc_m: Array, share: float, near_sign: float) -> Array:
    """Return (…, 2) the point of the ego's front at `share` of its width from the near side."""
    pose = ego.path.pose_at(arc_m, ego.offset_m)
    across = near_sign * (share - 0.5) * box.width_m
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    forward = np.stack([cos, sin], axis=-1)
    left = np.stack([-sin, cos], axis=-1)
    return np.asarray(pose.xy_m + box.front_m * forward + across * left)


def find_impact(
    ego: Moving,
    box: EgoBox,
    actor: Moving,
    traits: KindTraits,
    *,
    ego_span: Span,
    actor_span: Span,
    share: float,
    near_sign: float,
    lead_time_s: float,
) -> Impact | None:
    """Return the first touch at `share` of the ego's front within both spans, or None.

    Nothing touches in the `lead_time_s` before it.
    """
    at_ego = np.arange(ego_span.from_m, ego_span.to_m, _SPACING_M)
    at_actor = np.arange(actor_span.from_m, actor_span.to_m, _SPACING_M)
    if len(at_ego) < 2 or len(at_actor) < 2:
        return None
    front = front_point(ego, box, at_ego, share, near_sign)
    pose = actor.path.pose_at(at_actor, actor.offset_m)
    offset = _OUTLINE * (traits.length_m, traits.width_m)
    cos, sin = np.cos(pose.yaw_rad)[:, None], np.sin(pose.yaw_rad)[:, None]
    x = pose.xy_m[:, :1] + cos * offset[:, 0] - sin * offset[:, 1]
    y = pose.xy_m[:, 1:] + sin * offset[:, 0] + cos * offset[:, 1]
    found = _meetings(front, x, y)
    if found is None:
        return None
    which, ego_share, actor_share = found
    ego_arc = ego_span.from_m + ego_share * _SPACING_M
    actor_arc = actor_span.from_m + actor_share * _SPACING_M
    touch = first_touch(
        ego, box, actor, traits, ego_arc_m=ego_arc - ego.speed_mps * lead_time_s,
        actor_arc_m=actor_arc - actor.speed_mps * lead_time_s, until_s=lead_time_s + _AFTER_S,
        early_ticks=True,
    )  # fmt: skip
    planned = front_point(ego, box, ego_arc, share, near_sign)
    met = front_point(ego, box, touch.ego_arc_m, share, near_sign)
    good = np.isfinite(touch.time_s) & (np.hypot(*(met - planned).T) <= TOLERANCE_M)
    good &= gap_m(met, actor, traits, touch.actor_arc_m) <= TOLERANCE_M
    good &= _goes_on(ego, box, actor, traits, touch)
    order = np.lexsort((ego_arc, which, ~good))
    for best in order[: int(good.sum())].tolist():
        impact = Impact(float(ego_arc[best]), float(actor_arc[best]), planned[best], share)
        if _is_first(ego, box, actor, traits, impact, lead_time_s):
            return impact
    return None


def _is_first(
    ego: Moving,
    box: EgoBox,
    actor: Moving,
    traits: KindTraits,
    impact: Impact,
    lead_time_s: float,
) -> bool:
    """Return whether nothing comes near a touch until shortly before an impact."""
    until_s = lead_time_s - _FINE_FOR_S
    if until_s <= 0.0:
        return True
    wider = traits._replace(
        length_m=traits.length_m + 2 * _CLEAR_M, width_m=traits.width_m + 2 * _CLEAR_M
    )
    touch = first_touch(
        ego, box, actor, wider, until_s=until_s,
        ego_arc_m=np.array([impact.ego_arc_m - ego.speed_mps * lead_time_s]),
        actor_arc_m=np.array([impact.actor_arc_m - actor.speed_mps * lead_time_s]),
    )  # fmt: skip
    return not np.isfinite(touch.time_s[0])


def _goes_on(
    ego: Moving, box: EgoBox, actor: Moving, traits: KindTraits, touch: Touch
) -> npt.NDArray[np.bool_]:
    """Return (C,) whether boxes press into each other after the touch, and do not merely brush."""
    smaller = traits._replace(
        length_m=traits.length_m - _BRUSH_M, width_m=traits.width_m - _BRUSH_M
    )
    return overlapping(
        ego_rectangles(ego, box, touch.ego_arc_m + ego.speed_mps * _PRESS_S),
        rectangles(actor, smaller, touch.actor_arc_m + actor.speed_mps * _PRESS_S),
    )


def _meetings(front: Array, x: Array, y: Array) -> tuple[npt.NDArray[np.intp], Array, Array] | None:
    """Return where outline curves cross the front's: (C,) curve, and places along both in points.

    `front` (M, 2); `x`, `y` (N, K) for K outline points.
    """
    trace = shapely.linestrings(front)
    curves = shapely.linestrings(np.stack([x.T, y.T], axis=-1))
    meet = np.flatnonzero(shapely.intersects(curves, trace))
    if not len(meet):
        return None
    points, of = shapely.get_coordinates(
        shapely.intersection(curves[meet], trace), return_index=True
    )
    which = meet[of]
    at = shapely.points(points)
    on_front = _places(shapely.line_locate_point(trace, at), front)
    on_curve = np.empty(len(at))
    for curve in np.unique(which):
        mine = which == curve
        along = np.stack([x[:, curve], y[:, curve]], axis=-1)
        on_curve[mine] = _places(shapely.line_locate_point(curves[curve], at[mine]), along)
    return which, on_front, on_curve


def _places(distance_m: Array, xy_m: Array) -> Array:
    """Return places counted in points of a polyline for distances along it."""
    walked = arc_lengths(xy_m)
    return np.asarray(np.interp(distance_m, walked, np.arange(len(walked))))


def first_touch(
    ego: Moving,
    box: EgoBox,
    actor: Moving,
    traits: KindTraits,
    *,
    ego_arc_m: Array,
    actor_arc_m: Array,
    until_s: float,
    early_ticks: bool = False,
) -> Touch:
    """Return the first touch of boxes that start at arc lengths (C,) before `until_s`.

    With `early_ticks` only what happens shortly before the end is looked at closely.
    """
    fine_from_s = max(0.0, until_s - _FINE_FOR_S) if early_ticks else 0.0
    ticks = np.concatenate(
        [np.arange(0.0, fine_from_s, _EARLY_TICK_S), np.arange(fine_from_s, until_s, _TICK_S)]
    )

    def touching(time_s: Array, rows: slice | npt.NDArray[np.intp]) -> npt.NDArray[np.bool_]:
        ego_at = ego_arc_m[rows, None] + ego.travelled_m(time_s)
        actor_at = actor_arc_m[rows, None] + actor.travelled_m(time_s)
        return overlapping(ego_rectangles(ego, box, ego_at), rectangles(actor, traits, actor_at))

    hit = touching(ticks[None, :], slice(None))
    rows = np.flatnonzero(hit.any(axis=1))
    first = hit[rows].argmax(axis=1)
    late = ticks[first]
    early = np.where(first > 0, ticks[np.maximum(first - 1, 0)], 0.0)
    for _ in range(_BISECTIONS):
        middle = (early + late) / 2.0
        inside = touching(middle[:, None], rows)[:, 0]
        early, late = np.where(inside, early, middle), np.where(inside, middle, late)
    time = np.full(len(ego_arc_m), np.inf)
    time[rows] = late
    end = np.minimum(time, until_s)
    return Touch(time, ego_arc_m + ego.travelled_m(end), actor_arc_m + actor.travelled_m(end))


def ego_rectangles(ego: Moving, box: EgoBox, arc_m: Array) -> Rectangles:
    """Return the ego's box with base_link at arc lengths (…)."""
    pose = ego.path.pose_at(arc_m, ego.offset_m)
    ahead = box.centre_m * np.stack([np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)], axis=-1)
    return Rectangles(pose.xy_m + ahead, pose.yaw_rad, box.length_m, box.width_m)


def rectangles(actor: Moving, traits: KindTraits, arc_m: Array) -> Rectangles:
    """Return another road user's box with its centre at arc lengths (…)."""
    pose = actor.path.pose_at(arc_m, actor.offset_m)
    return Rectangles(pose.xy_m, pose.yaw_rad, traits.length_m, traits.width_m)


def gap_m(point: Array, actor: Moving, traits: KindTraits, arc_m: Array) -> Array:
    """Return (…) the distance from points (…, 2) to the box at arc lengths (…)."""
    pose = actor.path.pose_at(arc_m, actor.offset_m)
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    dx, dy = point[..., 0] - pose.xy_m[..., 0], point[..., 1] - pose.xy_m[..., 1]
    along = np.maximum(np.abs(cos * dx + sin * dy) - traits.length_m / 2.0, 0.0)
    across = np.maximum(np.abs(cos * dy - sin * dx) - traits.width_m / 2.0, 0.0)
    return np.asarray(np.hypot(along, across))
