"""Actors on the ego's own path or beside it: ahead, behind, beside, parked."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from contracts.arrays import Array
from contracts.scenario import ActorPart
from sim_worker.actors.kinds import KINDS
from sim_worker.planners.path import FrenetPath
from sim_worker.scenarios.impact import TOLERANCE_M, Moving, first_touch, front_point, gap_m
from sim_worker.scenarios.roles import CastActor, Meeting, Staging
from sim_worker.scenarios.ways import Way
from world_gen.polyline import length

_CLEAR_M, _LANE_HALF_M = 0.3, 1.5
"""What is parked leaves the lane free, and a car's side by so much."""


class Touched(NamedTuple):
    """When, where and at which share of its front the ego touches somebody."""

    time_s: float
    point_m: Array
    share: float


def along(part: ActorPart, staging: Staging, meetings: dict[str, Meeting]) -> CastActor:
    """Return an actor on the ego's path or beside it; who hides another stands before its way."""
    place, box = staging.place, staging.box
    traits, gap = KINDS[part.kind], staging.number(part, "gap_m")
    half = traits.length_m / 2.0
    lateral = place.near_sign * staging.number(part, "lateral_m")
    free = max(box.width_m / 2.0 + _CLEAR_M, _LANE_HALF_M)
    beside = staging.ego.offset_m - place.near_sign * (free + traits.width_m / 2.0)
    arc = staging.start_m + box.front_m + gap + half
    if part.relation == "parked":
        lateral = lateral or beside
        for other in staging.scenario.actors:
            if other.hidden_by == part.name and other.name in meetings:
                impact, way = meetings[other.name]
                stands = way.path.point_at(np.array([impact.actor_arc_m]))
                line = float(place.ego.path.locate(stands).arc_m[0])
                arc = line - KINDS[other.kind].width_m / 2.0 - gap - half
    elif part.relation == "behind":
        arc = staging.start_m + box.front_m - box.length_m - gap - half
    elif part.relation == "beside":
        arc, lateral = staging.start_m + box.centre_m, lateral or beside
    return staging.actor(part, place.ego.xy_m, arc, lateral, place.ego.name)


def beside_bay(part: ActorPart, staging: Staging, way: Way) -> CastActor:
    """Return a car in the bay behind the ego's or ahead of it."""
    away = (staging.box.length_m + KINDS[part.kind].length_m) / 2.0 + staging.number(part, "gap_m")
    arc = way.entry_m + (away if part.relation == "ahead" else -away)
    return staging.actor(part, way.xy_m, arc, 0.0, way.name)


def closing_time_s(part: ActorPart, staging: Staging) -> float | None:
    """Return after how many seconds a steady ego closes the gap to who is ahead, if it does."""
    time = np.arange(0.0, staging.scenario.horizon_s, 0.01)
    after = staging.number(part, "acts_after_s") if part.conduct == "stops" else math.inf
    speed, decel = staging.number(part, "speed_mps"), staging.number(part, "decel_mps2")
    ahead = Moving(_ANYWHERE, speed, 0.0, after, decel).travelled_m(time)
    gap = staging.number(part, "gap_m") + ahead - staging.ego.speed_mps * time
    closed = np.flatnonzero(gap <= 0.0)
    return float(time[closed[0]]) if len(closed) else None


_ANYWHERE = FrenetPath(np.array([[0.0, 0.0], [1.0, 0.0]]))


def run_into(actor: CastActor, staging: Staging) -> Touched | None:
    """Return the first touch of who drives ahead, if the ego's front makes it."""
    after = actor.acts_after_s if actor.conduct == "stops" else math.inf
    place = staging.place
    moving = Moving(place.ego.path, actor.speed_mps, actor.lateral_m, after, actor.decel_mps2)
    # Its path may have been led back: on the ego's it starts by so much earlier.
    start = actor.start_arc_m - (length(actor.xy_m) - length(place.ego.xy_m))
    touch = first_touch(
        staging.ego, staging.box, moving, actor.traits, ego_arc_m=np.array([staging.start_m]),
        actor_arc_m=np.array([start]), until_s=staging.scenario.horizon_s,
    )  # fmt: skip
    if not np.isfinite(touch.time_s[0]):
        return None
    shares = np.linspace(0.0, 1.0, 41)
    points = np.concatenate(
        [
            front_point(staging.ego, staging.box, touch.ego_arc_m, share, place.near_sign)
            for share in shares
        ]
    )
    gaps = gap_m(points, moving, actor.traits, np.full(len(shares), touch.actor_arc_m[0]))
    on_front = np.flatnonzero(gaps <= TOLERANCE_M / 2)
    if not len(on_front):
        return None
    middle = float(shares[on_front].mean())
    best = int(on_front[np.abs(shares[on_front] - middle).argmin()])
    return Touched(float(touch.time_s[0]), points[best], float(shares[best]))
