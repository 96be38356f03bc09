"""One case of a scenario at one place: who starts where, how fast, and what happens when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contracts.arrays import Array
from contracts.drive import RoadUserKind
from contracts.scenario import EGO, ActorPart, Conduct, Relation, Scenario
from contracts.vehicle import VehicleParameters
from sim_worker.actors.kinds import KINDS, KindTraits
from sim_worker.planners.path import FrenetPath
from sim_worker.scenarios.drawing import Values
from sim_worker.scenarios.impact import (
    TOLERANCE_M,
    EgoBox,
    Impact,
    Moving,
    Span,
    ego_box,
    find_impact,
    first_touch,
    front_point,
    gap_m,
)
from sim_worker.scenarios.places import Place, Unplaced
from sim_worker.scenarios.roads import Way

LEAST_TIME_S = 0.8
"""Nothing is staged that is over sooner."""
_LEAST_SPEED_MPS = 2.0
"""A car that stands is taken to set off with this speed."""
_SHARES = (0.5, 0.25, 0.75, 0.0, 1.0)
_AROUND_M, _MOUTH_M = 40.0, 15.0
_PARKED_CLEAR_M = 0.3
"""Between the ego's side and what is parked beside its path, at least."""
_LEAD_BACK_M = 200.0
_ALONG: tuple[Relation, ...] = ("ahead", "behind", "beside", "parked")


class CastActor(NamedTuple):
    """Another road user of a case.

    `xy_m` (N, 2) is its own path; its box's centre starts at `start_arc_m` of it, `lateral_m` to
    the left. It moves with `speed_mps` until, if it stops, it brakes with `decel_mps2` after
    `acts_after_s`.
    """

    name: str
    kind: RoadUserKind
    relation: Relation
    xy_m: Array
    start_arc_m: float
    lateral_m: float
    speed_mps: float
    conduct: Conduct
    acts_after_s: float
    decel_mps2: float
    hidden_by: str
    way: str
    """The connections or the line that it takes."""

    @property
    def traits(self) -> KindTraits:
        """Return the sizes and limits of its kind."""
        return KINDS[self.kind]


class Cast(NamedTuple):
    """Everybody's start in one case, in the World's frame.

    The ego's base_link starts at `ego_arc_m` of `ego_xy_m` (N, 2), `ego_lateral_m` to its left;
    `reverse` says that it drives backwards along it. Where a touch is planned, an ego that keeps
    its speed touches the first road user after `impact_time_s` with its front's point
    `impact_share` at `impact_point_m` (2,); else the three are NaN.
    """

    scenario_id: str
    place: Place
    values: Values
    actors: tuple[CastActor, ...]
    ego_xy_m: Array
    ego_speed_limit_mps: Array
    ego_arc_m: float
    ego_lateral_m: float
    ego_speed_mps: float
    reverse: bool
    impact_time_s: float
    impact_point_m: Array
    impact_share: float
    impact_with: str
    off_lanes_m: float
    """How far beyond the World's lanes the ego or an actor starts, on a road prolonged."""


def cast(
    scenario: Scenario,
    values: Values,
    place: Place,
    *,
    vehicle: VehicleParameters,
    ego_arc_m: float | None = None,
    ego_speed_mps: float | None = None,
) -> Cast | Unplaced:
    """Return one case at one place, or why these values cannot be played there.

    Live, `ego_arc_m` (of base_link on the place's ego path) and `ego_speed_mps` are the car's;
    without them the ego starts `lead_time_s` before the impact with the speed in `values`, later
    where its lane begins later.
    """
    return _cast(scenario, values, place, vehicle, ego_arc_m, ego_speed_mps, {})


def cast_all(
    scenario: Scenario,
    cases: Sequence[Values],
    place: Place,
    *,
    vehicle: VehicleParameters,
    ego_arc_m: float | None = None,
    ego_speed_mps: float | None = None,
) -> tuple[Cast | Unplaced, ...]:
    """Return what `cast` does for each case; cases that differ elsewhere share the search."""
    met: _Met = {}
    return tuple(
        _cast(scenario, values, place, vehicle, ego_arc_m, ego_speed_mps, met) for values in cases
    )


_Met = dict[tuple[str, float, float, float, float], "tuple[Impact, Way] | None"]
"""Impacts by actor, its speed and share, and the ego's speed and shift: all that they depend on."""


def _cast(
    scenario: Scenario,
    values: Values,
    place: Place,
    vehicle: VehicleParameters,
    ego_arc_m: float | None,
    ego_speed_mps: float | None,
    met: _Met,
) -> Cast | Unplaced:
    numbers = _Numbers(values)
    box = ego_box(vehicle, reverse=place.reverse)
    speed = numbers.ego("speed_mps") if ego_speed_mps is None else ego_speed_mps
    speed = max(speed, min(_LEAST_SPEED_MPS, numbers.ego("speed_mps")) or _LEAST_SPEED_MPS)
    ego = Moving(place.ego.path, speed, numbers.ego("lateral_shift_m"))
    impacts: dict[str, tuple[Impact, Way]] = {}
    for part, ways in zip(scenario.actors, place.actor_ways, strict=True):
        if part.relation in _ALONG:
            continue
        key = (
            part.name, numbers.of(part, "speed_mps"), numbers.of(part, "impact_share"),
            ego.speed_mps, ego.offset_m,
        )  # fmt: skip
        if key not in met:
            met[key] = _meet(part, ways, numbers, ego, box, place, scenario, ego_arc_m)
        found = met[key]
        if found is None:
            why = f"no way of {part.name} touches the ego's front before anything else"
            return Unplaced(place.junction_id, why, True)
        impacts[part.name] = found
    start = _start_arc(scenario, place, numbers, ego, box, impacts, ego_arc_m)
    actors = [
        _incoming(part, numbers, *impacts[part.name], start, speed)
        if part.name in impacts
        else _beside_bay(part, numbers, box, ways[0])
        if place.reverse and part.conduct == "parked" and ways
        else _along(part, scenario, numbers, ego, box, place, start, impacts)
        for part, ways in zip(scenario.actors, place.actor_ways, strict=True)
    ]
    time_s, point, share, other = _planned(
        scenario, numbers, ego, box, place, start, actors, impacts
    )
    reason = _out_of_bounds(scenario, place, actors, time_s)
    if reason:
        return Unplaced(place.junction_id, reason, True)
    way = place.ego
    off = [max(0.0, way.first_m - start)] if ego_arc_m is None else [0.0]
    off += [
        max(0.0, impacts[actor.name][1].first_m - actor.start_arc_m)
        for actor in actors
        if actor.name in impacts
    ]
    return Cast(
        scenario_id=scenario.id, place=place, values=values, actors=tuple(actors),
        ego_xy_m=way.xy_m, ego_speed_limit_mps=way.speed_limit_mps, ego_arc_m=start,
        ego_lateral_m=ego.offset_m, ego_speed_mps=speed, reverse=place.reverse,
        impact_time_s=time_s, impact_point_m=point, impact_share=share, impact_with=other,
        off_lanes_m=max(off),
    )  # fmt: skip


class _Numbers:
    """The drawn numbers of one case, by owner and field."""

    def __init__(self, values: Values) -> None:
        self._values = values

    def ego(self, field: str) -> float:
        return self._values[f"{EGO}.{field}"]

    def of(self, part: ActorPart, field: str) -> float:
        return self._values[f"{part.name}.{field}"]


def _meet(
    part: ActorPart,
    ways: tuple[Way, ...],
    numbers: _Numbers,
    ego: Moving,
    box: EgoBox,
    place: Place,
    scenario: Scenario,
    ego_arc_m: float | None,
) -> tuple[Impact, Way] | None:
    """Return where and by which way an actor meets the ego, as near the wished share as can be."""
    low, high = place.ego.entry_m - _AROUND_M, place.ego.exit_m + _AROUND_M
    if place.reverse:
        low, high = place.ego.first_m, place.ego.exit_m
    elif part.relation == "crosses_exit":
        low = place.ego.exit_m - _MOUTH_M
    elif part.relation == "crosses_entry":
        high = place.ego.entry_m + _MOUTH_M
    lead = scenario.lead_time_s
    if ego_arc_m is not None:
        low = max(low, ego_arc_m + ego.speed_mps * LEAST_TIME_S)
        lead = LEAST_TIME_S
    wished = numbers.of(part, "impact_share")
    walks = part.relation in ("crosses_exit", "crosses_entry")
    before, after = (2.0, 2.0) if walks else (10.0, 30.0)
    for share in sorted({wished, *_SHARES}, key=lambda other: abs(other - wished)):
        for way in ways:
            impact = find_impact(
                ego, box, Moving(way.path, numbers.of(part, "speed_mps")), KINDS[part.kind],
                ego_span=Span(low, high),
                actor_span=Span(way.entry_m - before, way.exit_m + after),
                share=share, near_sign=place.near_sign, lead_time_s=lead,
            )  # fmt: skip
            if impact is not None:
                return impact, way
    return None


def _start_arc(
    scenario: Scenario,
    place: Place,
    numbers: _Numbers,
    ego: Moving,
    box: EgoBox,
    impacts: dict[str, tuple[Impact, Way]],
    ego_arc_m: float | None,
) -> float:
    """Return where base_link starts: given, or so long before the impact or the junction."""
    if ego_arc_m is not None:
        return ego_arc_m
    end, time_s = place.ego.entry_m - box.front_m, scenario.lead_time_s
    for part in scenario.actors:
        if part.name in impacts:
            end = impacts[part.name][0].ego_arc_m
            break
        if part.relation == "ahead" and not place.reverse:
            time_s = _closing_time_s(part, numbers, ego.speed_mps, scenario.horizon_s) or time_s
            break
    room_s = (end - place.ego.first_m - box.length_m) / ego.speed_mps
    return end - ego.speed_mps * min(time_s, max(room_s, 2 * LEAST_TIME_S))


def _closing_time_s(
    part: ActorPart, numbers: _Numbers, speed_mps: float, horizon_s: float
) -> float | None:
    """Return after how many seconds a steady ego closes the gap to who is ahead, if it does."""
    time = np.arange(0.0, horizon_s, 0.01)
    ahead = Moving(_NOWHERE, numbers.of(part, "speed_mps"), 0.0, *_braking(part, numbers))
    gap = numbers.of(part, "gap_m") + ahead.travelled_m(time) - speed_mps * time
    closed = np.flatnonzero(gap <= 0.0)
    return float(time[closed[0]]) if len(closed) else None


def _braking(part: ActorPart, numbers: _Numbers) -> tuple[float, float]:
    """Return when an actor begins to brake, and how hard."""
    stops = part.conduct == "stops"
    after = numbers.of(part, "acts_after_s") if stops else math.inf
    return after, numbers.of(part, "decel_mps2")


_NOWHERE = FrenetPath(np.array([[0.0, 0.0], [1.0, 0.0]]))


def _incoming(
    part: ActorPart, numbers: _Numbers, impact: Impact, way: Way, start_m: float, ego_speed: float
) -> CastActor:
    """Return an actor that is at its place of impact when the ego is."""
    speed = numbers.of(part, "speed_mps")
    until_s = (impact.ego_arc_m - start_m) / ego_speed + numbers.of(part, "arrives_after_s")
    start = impact.actor_arc_m - speed * until_s
    xy, start = _led_back(way.xy_m, start)
    return _actor(part, numbers, xy, start, 0.0, way.name)


def _along(
    part: ActorPart,
    scenario: Scenario,
    numbers: _Numbers,
    ego: Moving,
    box: EgoBox,
    place: Place,
    start_m: float,
    impacts: dict[str, tuple[Impact, Way]],
) -> CastActor:
    """Return an actor on the ego's own path, or beside it."""
    traits = KINDS[part.kind]
    half = traits.length_m / 2.0
    gap = numbers.of(part, "gap_m")
    lateral = place.near_sign * numbers.of(part, "lateral_m")
    beside = -place.near_sign * (
        max(box.width_m / 2.0 + _PARKED_CLEAR_M, _LANE_HALF_M) + traits.width_m / 2.0
    )
    arc = start_m + box.front_m + gap + half
    hides = [other for other in scenario.actors if other.hidden_by == part.name]
    if part.relation == "parked":
        lateral = lateral or ego.offset_m + beside
        met = [impacts[other.name] for other in hides if other.name in impacts]
        if met:
            impact, way = met[0]
            hidden = KINDS[next(o.kind for o in hides if o.name in impacts)]
            stands = way.path.point_at(np.array([impact.actor_arc_m]))
            at = float(place.ego.path.locate(stands).arc_m[0])
            arc = at - hidden.width_m / 2.0 - gap - half
    elif part.relation == "behind":
        arc = start_m + box.front_m - box.length_m - gap - half
    elif part.relation == "beside":
        arc, lateral = start_m + box.centre_m, lateral or ego.offset_m + beside
    xy, arc = _led_back(place.ego.xy_m, arc)
    return _actor(part, numbers, xy, arc, lateral, place.ego.name)


_LANE_HALF_M = 1.5


def _beside_bay(part: ActorPart, numbers: _Numbers, box: EgoBox, way: Way) -> CastActor:
    """Return a car in the bay behind the ego's or ahead of it."""
    away = box.length_m / 2.0 + numbers.of(part, "gap_m") + KINDS[part.kind].length_m / 2.0
    arc = way.entry_m + (away if part.relation == "ahead" else -away)
    return _actor(part, numbers, way.xy_m, arc, 0.0, way.name)


def _actor(
    part: ActorPart, numbers: _Numbers, xy: Array, start_m: float, lateral_m: float, way: str
) -> CastActor:
    return CastActor(
        name=part.name,
        kind=part.kind,
        relation=part.relation,
        xy_m=xy,
        start_arc_m=start_m,
        lateral_m=lateral_m,
        speed_mps=0.0 if part.conduct == "parked" else numbers.of(part, "speed_mps"),
        conduct=part.conduct,
        acts_after_s=numbers.of(part, "acts_after_s"),
        decel_mps2=numbers.of(part, "decel_mps2"),
        hidden_by=part.hidden_by,
        way=way,
    )


def _led_back(xy: Array, start_m: float) -> tuple[Array, float]:
    """Lead a path straight back where somebody starts before its first point."""
    if start_m >= 1.0:
        return xy, start_m
    more = 1.0 - start_m
    first = xy[0] - xy[1]
    first = first / max(float(np.hypot(*first)), 1e-9)
    return np.concatenate([(xy[0] + more * first)[None], xy]), 1.0


def _planned(
    scenario: Scenario,
    numbers: _Numbers,
    ego: Moving,
    box: EgoBox,
    place: Place,
    start_m: float,
    actors: list[CastActor],
    impacts: dict[str, tuple[Impact, Way]],
) -> tuple[float, Array, float, str]:
    """Return when, where, at which share of the front and with whom the ego meets first."""
    for part in scenario.actors:
        if part.name in impacts and numbers.of(part, "arrives_after_s") == 0.0:
            impact = impacts[part.name][0]
            time_s = (impact.ego_arc_m - start_m) / ego.speed_mps
            return time_s, impact.point_m, impact.share, part.name
    for actor in actors:
        if actor.relation in ("ahead", "parked"):
            found = _run_into(actor, scenario.horizon_s, ego, box, place, start_m)
            if found is not None:
                return (*found, actor.name)
    return math.nan, np.full(2, math.nan), math.nan, ""


def _run_into(
    actor: CastActor, horizon_s: float, ego: Moving, box: EgoBox, place: Place, start_m: float
) -> tuple[float, Array, float] | None:
    """Return time, point and share of the first touch of who drives ahead, if its front is hit."""
    moving = Moving(
        place.ego.path, actor.speed_mps, actor.lateral_m,
        actor.acts_after_s if actor.conduct == "stops" else math.inf, actor.decel_mps2,
    )  # fmt: skip
    start = actor.start_arc_m - (_length(actor.xy_m) - _length(place.ego.xy_m))
    touch = first_touch(
        ego, box, moving, actor.traits, ego_arc_m=np.array([start_m]),
        actor_arc_m=np.array([start]), until_s=horizon_s,
    )  # fmt: skip
    if not np.isfinite(touch.time_s[0]):
        return None
    shares = np.linspace(0.0, 1.0, 41)
    points = np.concatenate(
        [front_point(ego, box, touch.ego_arc_m, s, place.near_sign) for s in shares]
    )
    gaps = gap_m(points, moving, actor.traits, np.full(len(shares), touch.actor_arc_m[0]))
    on_front = np.flatnonzero(gaps <= TOLERANCE_M / 2)
    if not len(on_front):
        return None
    middle = float(shares[on_front].mean())
    best = int(on_front[np.abs(shares[on_front] - middle).argmin()])
    return float(touch.time_s[0]), points[best], float(shares[best])


def _length(xy: Array) -> float:
    return float(np.hypot(*np.diff(xy, axis=0).T).sum())


def _out_of_bounds(scenario: Scenario, place: Place, actors: list[CastActor], time_s: float) -> str:
    if time_s > scenario.horizon_s:
        return f"the impact would be in {time_s:.1f} s, after the end at {scenario.horizon_s:g} s"
    left, right = place.edges_m
    for actor in actors:
        if not right - _VERGE_M <= actor.lateral_m <= left + _VERGE_M:
            return (
                f"{actor.name} would be {abs(actor.lateral_m):.1f} m beside the ego's path, off "
                f"the road, which reaches {left if actor.lateral_m > 0.0 else -right:.1f} m there"
            )
    return ""


_VERGE_M = 4.0
"""Beside the road, where one may still stand or park."""
