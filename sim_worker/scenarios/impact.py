"""Where two road users must be so that the ego's front touches the other at a planned point.

Neither reacts or swerves: the ego keeps its speed, the other slows down for bends alone. The point
of the front that is to be hit draws a curve along the ego's path, each point of the other's outline
one along the other's; where two such curves cross, the two points can meet. Of all such meetings
those count before which the boxes touch nowhere else, which a simulation in closed form finds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.geometry.polyline import arc_lengths
from foretwin.geometry.rectangles import Rectangles, overlapping
from foretwin.sim_worker.road_users.paces import Paces
from foretwin.sim_worker.vehicle.reference_points import box_centre_from_base_m, front_from_base_m

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
_OUTLINE = np.column_stack(
    [
        [0.25, 0.25, 0.0, 0.0, 0.5, 0.5, 0.5, 0.5, 0.5, -0.25, -0.25, -0.5, -0.5, -0.5],
        [0.5, -0.5, 0.5, -0.5, 0.5, -0.5, 0.0, 0.25, -0.25, 0.5, -0.5, 0.5, -0.5, 0.0],
    ]
)
"""Points of the other's outline in its length and width, the likeliest to be hit first."""


Span = tuple[float, float]
"""A stretch of a path between two arc lengths."""


class MovingBox(NamedTuple):
    """A box that moves along a path, `offset_m` to the left of it, until it brakes: at its pace, or
    else with one speed.

    From the point of it that follows the path, its leading end lies `front_m` ahead and its centre
    `centre_m`: base_link of the ego, the centre itself of others.
    """

    path: FrenetPath
    speed_mps: float
    length_m: float
    width_m: float
    offset_m: float = 0.0
    brakes_after_s: float = math.inf
    decel_mps2: float = 0.0
    front_m: float = 0.0
    centre_m: float = 0.0
    paces: Paces | None = None
    """Its motion, the first of them."""

    def arc_after(self, start_m: Array | float, time_s: Array | float) -> Array:
        """Return the arc length (…) at which it is so many seconds after it was at `start_m`.

        Before that, it came as it moves.
        """
        brakes_after, decel = self.brakes_after_s, self.decel_mps2
        if decel <= 0.0:
            brakes_after, decel = math.inf, 1.0
        if self.paces is not None:
            clock_s = self.paces.time_at(0, np.asarray(start_m))
            return self.paces.braked(0, clock_s + time_s, clock_s + brakes_after, decel).arc_m
        braking = np.clip(np.asarray(time_s) - brakes_after, 0.0, self.speed_mps / decel)
        steady = np.minimum(time_s, brakes_after)
        return np.asarray(start_m + self.speed_mps * (steady + braking) - decel * braking**2 / 2.0)

    def rectangles(self, arc_m: Array) -> Rectangles:
        """Return the box at arc lengths (…)."""
        pose = self.path.pose_at(arc_m, self.offset_m)
        ahead = self.centre_m * np.stack([np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)], axis=-1)
        return Rectangles(pose.xy_m + ahead, pose.yaw_rad, self.length_m, self.width_m)

    def with_room(self, room_m: float) -> MovingBox:
        """Return the box with so much room on all sides; its points stay where they are."""
        return self._replace(length_m=self.length_m + 2 * room_m, width_m=self.width_m + 2 * room_m)


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


def ego_box(
    vehicle: VehicleParameters,
    path: FrenetPath,
    speed_mps: float,
    offset_m: float = 0.0,
    *,
    reverse: bool = False,
) -> MovingBox:
    """Return the ego's box on a path; in reverse its rear leads."""
    length, front = vehicle.length_m.value, front_from_base_m(vehicle)
    centre = box_centre_from_base_m(vehicle)
    if reverse:
        front, centre = vehicle.rear_overhang_m.value, -centre
    return MovingBox(
        path, speed_mps, length, vehicle.width_m.value, offset_m, front_m=front, centre_m=centre
    )


def front_point(ego: MovingBox, arc_m: Array, share: float, near_sign: float) -> Array:
    """Return (…, 2) the point of the ego's front at `share` of its width from the near side."""
    pose = ego.path.pose_at(arc_m, ego.offset_m)
    across = near_sign * (share - 0.5) * ego.width_m
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    forward = np.stack([cos, sin], axis=-1)
    left = np.stack([-sin, cos], axis=-1)
    return np.asarray(pose.xy_m + ego.front_m * forward + across * left)


def find_impact(
    ego: MovingBox,
    actor: MovingBox,
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
    at_ego, at_actor = np.arange(*ego_span, _SPACING_M), np.arange(*actor_span, _SPACING_M)
    if len(at_ego) < 2 or len(at_actor) < 2:
        return None
    front = front_point(ego, at_ego, share, near_sign)
    pose = actor.path.pose_at(at_actor, actor.offset_m)
    offset = _OUTLINE * (actor.length_m, actor.width_m)
    cos, sin = np.cos(pose.yaw_rad)[:, None], np.sin(pose.yaw_rad)[:, None]
    x = pose.xy_m[:, :1] + cos * offset[:, 0] - sin * offset[:, 1]
    y = pose.xy_m[:, 1:] + sin * offset[:, 0] + cos * offset[:, 1]
    found = _meetings(front, x, y)
    if found is None:
        return None
    which, ego_share, actor_share = found
    ego_arc = ego_span[0] + ego_share * _SPACING_M
    actor_arc = actor_span[0] + actor_share * _SPACING_M
    ego_start = ego.arc_after(ego_arc, -lead_time_s)
    actor_start = actor.arc_after(actor_arc, -lead_time_s)
    touch = first_touch(
        ego, actor, ego_start, actor_start, until_s=lead_time_s + _AFTER_S, early_ticks=True
    )
    planned = front_point(ego, ego_arc, share, near_sign)
    met = front_point(ego, touch.ego_arc_m, share, near_sign)
    good = np.isfinite(touch.time_s) & (np.hypot(*(met - planned).T) <= TOLERANCE_M)
    good &= gap_m(met, actor, touch.actor_arc_m) <= TOLERANCE_M
    # Boxes that press into each other after the touch do not merely brush.
    good &= overlapping(
        ego.rectangles(ego.arc_after(touch.ego_arc_m, _PRESS_S)),
        actor.with_room(-_BRUSH_M / 2).rectangles(actor.arc_after(touch.actor_arc_m, _PRESS_S)),
    )
    order, wider = np.lexsort((ego_arc, which, ~good)), actor.with_room(_CLEAR_M)
    for best in order[: int(good.sum())].tolist():
        # Nothing may come near a touch until shortly before an impact.
        starts, early_s = (ego_start[best], actor_start[best]), lead_time_s - _FINE_FOR_S
        if early_s <= 0.0 or np.isinf(first_touch(ego, wider, *starts, until_s=early_s).time_s[0]):
            return Impact(float(ego_arc[best]), float(actor_arc[best]), planned[best], share)
    return None


def _meetings(front: Array, x: Array, y: Array) -> tuple[Indices, Array, Array] | None:
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
    ego: MovingBox,
    actor: MovingBox,
    ego_arc_m: Array | float,
    actor_arc_m: Array | float,
    *,
    until_s: float,
    early_ticks: bool = False,
) -> Touch:
    """Return the first touch of boxes that start at arc lengths (C,), or one, before `until_s`.

    With `early_ticks` only what happens shortly before the end is looked at closely.
    """
    ego_from, actor_from = np.atleast_1d(ego_arc_m), np.atleast_1d(actor_arc_m)
    fine_from_s = max(0.0, until_s - _FINE_FOR_S) if early_ticks else 0.0
    ticks = np.concatenate(
        [np.arange(0.0, fine_from_s, _EARLY_TICK_S), np.arange(fine_from_s, until_s, _TICK_S)]
    )

    def touching(time_s: Array, rows: slice | Indices) -> Flags:
        ego_at = ego.arc_after(ego_from[rows, None], time_s)
        actor_at = actor.arc_after(actor_from[rows, None], time_s)
        return overlapping(ego.rectangles(ego_at), actor.rectangles(actor_at))

    hit = touching(ticks[None, :], slice(None))
    rows = np.flatnonzero(hit.any(axis=1))
    first = hit[rows].argmax(axis=1)
    late = ticks[first]
    early = np.where(first > 0, ticks[np.maximum(first - 1, 0)], 0.0)
    for _ in range(_BISECTIONS if len(rows) else 0):
        middle = (early + late) / 2.0
        inside = touching(middle[:, None], rows)[:, 0]
        early, late = np.where(inside, early, middle), np.where(inside, middle, late)
    time = np.full(len(ego_from), np.inf)
    time[rows] = late
    end = np.minimum(time, until_s)
    return Touch(time, ego.arc_after(ego_from, end), actor.arc_after(actor_from, end))


def gap_m(point: Array, actor: MovingBox, arc_m: Array) -> Array:
    """Return (…) the distance from points (…, 2) to the box at arc lengths (…)."""
    pose = actor.path.pose_at(arc_m, actor.offset_m)
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    dx, dy = point[..., 0] - pose.xy_m[..., 0], point[..., 1] - pose.xy_m[..., 1]
    along = np.maximum(np.abs(cos * dx + sin * dy) - actor.length_m / 2.0, 0.0)
    across = np.maximum(np.abs(cos * dy - sin * dx) - actor.width_m / 2.0, 0.0)
    return np.asarray(np.hypot(along, across))
