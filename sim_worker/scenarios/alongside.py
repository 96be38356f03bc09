"""Actors on the ego's own path or beside it: ahead, behind, beside, parked."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.scenario import ActorPart
from foretwin.geometry.rectangles import corners
from foretwin.sim_worker.road_users.paces import briskness
from foretwin.sim_worker.scenarios.impact import (
    TOLERANCE_M,
    MovingBox,
    Touch,
    first_touch,
    front_point,
    gap_m,
)
from foretwin.sim_worker.scenarios.roles import PlannedMeeting, StagedActor, Staging, moving_box
from foretwin.sim_worker.scenarios.ways import Way
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

_CLEAR_M, _LANE_HALF_M = 0.3, 1.5
"""What is parked leaves the lane free, and a car's side by so much."""
_BAY_CLEAR_M, _PASS_CLEAR_M = 0.3, 0.05
"""Room on all sides of who is parked: beside a bay, and where the ego drives past. Without it a
corner that is brushed between two ticks of the search would go unseen."""


class Touched(NamedTuple):
    """When, where and at which share of its front the ego touches a road user."""

    time_s: float
    point_m: Array
    share: float


def along(part: ActorPart, staging: Staging, meetings: dict[str, PlannedMeeting]) -> StagedActor:
    """Return an actor on the ego's path or beside it; who hides another stands before its way."""
    place, box = staging.place, staging.ego
    traits, gap = KINDS[part.kind], staging.number(part, "gap_m")
    half = traits.length_m / 2.0
    lateral = place.near_sign * staging.number(part, "lateral_m")
    free = max(box.width_m / 2.0 + _CLEAR_M, _LANE_HALF_M)
    beside = staging.ego.offset_m - place.near_sign * (free + traits.width_m / 2.0)
    arc = staging.start_m + box.front_m + gap + half
    if part.relation == "parked":
        for other in staging.scenario.actors:
            if other.hidden_by == part.name and other.name in meetings:
                impact, way = meetings[other.name]
                stands = way.path.point_at(np.array([impact.actor_arc_m]))
                line = float(place.ego.path.locate(stands).arc_m[0])
                arc = line - KINDS[other.kind].width_m / 2.0 - gap - half
        lateral = lateral or _out_of_the_way(part, staging, arc, beside)
    elif part.relation == "behind":
        arc = staging.start_m + box.front_m - box.length_m - gap - half
    elif part.relation == "beside":
        arc, lateral = staging.start_m + box.centre_m, lateral or beside
    return staging.actor(part, place.ego.xy_m, arc, lateral, place.ego.name)


def _out_of_the_way(part: ActorPart, staging: Staging, arc_m: float, beside_m: float) -> float:
    """Return how far beside the path a box must stand that the ego passes it, in curves as well."""
    step, size = math.copysign(_ASIDE_STEP_M, beside_m), KINDS[part.kind]
    for number in range(_ASIDE_STEPS):
        lateral = beside_m + number * step
        parked = MovingBox(staging.place.ego.path, 0.0, size.length_m, size.width_m, lateral)
        touch = _touch(staging, parked.with_room(_PASS_CLEAR_M), arc_m)
        if not np.isfinite(touch.time_s[0]):
            # Where it had to be moved, a step more leaves the ego a margin.
            return lateral if number == 0 else lateral + step
    return beside_m


_ASIDE_STEPS, _ASIDE_STEP_M = 10, 0.3


def beside_bay(part: ActorPart, staging: Staging, way: Way) -> StagedActor:
    """Return a car in the bay behind the ego's or ahead of it."""
    away = (staging.ego.length_m + KINDS[part.kind].length_m) / 2.0 + staging.number(part, "gap_m")
    arc = way.entry_m + (away if part.relation == "ahead" else -away)
    return staging.actor(part, way.xy_m, arc, 0.0, way.name)


def closing_time_s(part: ActorPart, staging: Staging, end_m: float) -> float | None:
    """Return after how many seconds a steady ego closes the gap to who is ahead, if it does: having
    begun so early that base_link is at `end_m` then."""
    ego, gap, decel = staging.ego, staging.number(part, "gap_m"), staging.number(part, "decel_mps2")
    time = np.arange(0.0, staging.scenario.horizon_s, 0.01)
    box = moving_box(
        part.kind,
        ego.path,
        staging.number(part, "speed_mps"),
        brisk=briskness(part.conduct, decel),
    )
    if part.conduct == "stops":
        brakes_after = staging.number(part, "acts_after_s")
        box = box._replace(brakes_after_s=brakes_after, decel_mps2=decel)
    found = staging.scenario.lead_time_s
    # Where it begins, the other may have a bend ahead: both are found together.
    for _ in range(_ROUNDS):
        start = end_m - ego.speed_mps * found
        other = start + ego.front_m + gap + box.length_m / 2.0
        left = gap + box.arc_after(other, time) - other - ego.speed_mps * time
        closed = np.flatnonzero(left <= 0.0)
        if not len(closed):
            return None
        found = float(time[closed[0]])
    return found


_ROUNDS = 4


def _touch(
    staging: Staging, other: MovingBox, arc_m: float, *, until_s: float | None = None
) -> Touch:
    """Return the first touch of the ego by a box that starts at an arc length of its own path."""
    end_s = staging.scenario.horizon_s if until_s is None else until_s
    return first_touch(staging.ego, other, staging.start_m, arc_m, until_s=end_s)


def stands_in_the_way(actor: StagedActor, staging: Staging) -> bool:
    """Return whether the ego touches a road user beside its path, with any side.

    One that backs into a bay goes no farther than its way, and needs room for being off it.
    """
    place, until_s, room_m = staging.place, None, _PASS_CLEAR_M
    way = place.ego
    if place.reverse:
        way, room_m = place.way_named(actor.way), _BAY_CLEAR_M
        until_s = (place.ego.path.length_m - staging.start_m) / staging.ego.speed_mps
    box = actor.moving(way.path).with_room(room_m)
    touch = _touch(staging, box, actor.start_on(way), until_s=until_s)
    return bool(np.isfinite(touch.time_s[0]))


def backs_into_a_building(staging: Staging) -> bool:
    """Return whether an ego that keeps to its line into a bay touches a building, or nearly so."""
    walls, path = staging.place.walls, staging.place.ego.path
    if walls is None or not staging.place.reverse:
        return False
    arcs = np.arange(staging.start_m, path.length_m, 0.5)
    outlines = corners(staging.ego.with_room(_BAY_CLEAR_M).rectangles(arcs))
    return any(walls.meet(shapely.Polygon(outline)) for outline in outlines)


def stands_in_a_building(actor: StagedActor, staging: Staging) -> bool:
    """Return whether a parked vehicle would stand in a building."""
    walls, way = staging.place.walls, staging.place.way_named(actor.way)
    arc, half = actor.start_on(way), actor.traits.length_m / 2.0
    return walls is not None and walls.block(
        way.path, arc - half, arc + half, width_m=actor.traits.width_m, left_m=actor.lateral_m
    )


def run_into(actor: StagedActor, staging: Staging) -> Touched | None:
    """Return the first touch of who drives ahead, if the ego's front makes it."""
    ego, way = staging.ego, staging.place.ego
    ahead = actor.moving(way.path)
    touch = _touch(staging, ahead, actor.start_on(way))
    if not np.isfinite(touch.time_s[0]):
        return None
    shares, sign = np.linspace(0.0, 1.0, 41), staging.place.near_sign
    points = np.concatenate([front_point(ego, touch.ego_arc_m, s, sign) for s in shares])
    gaps = gap_m(points, ahead, np.full(len(shares), touch.actor_arc_m[0]))
    on_front = np.flatnonzero(gaps <= TOLERANCE_M / 2)
    if not len(on_front):
        return None
    middle = float(shares[on_front].mean())
    best = int(on_front[np.abs(shares[on_front] - middle).argmin()])
    return Touched(float(touch.time_s[0]), points[best], float(shares[best]))
