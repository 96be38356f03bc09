"""One case of a scenario at one place: who starts where, how fast, and what happens when."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from foretwin.contracts.scenario import EGO, Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.driver_model import LEAST_START_MPS
from foretwin.sim_worker.scenarios.alongside import (
    Touched,
    along,
    backs_into_a_building,
    beside_bay,
    closing_time_s,
    run_into,
    stands_in_a_building,
    stands_in_the_way,
)
from foretwin.sim_worker.scenarios.drawing import Values
from foretwin.sim_worker.scenarios.impact import MovingBox, ego_box
from foretwin.sim_worker.scenarios.meeting import LEAST_TIME_S, incoming, meet
from foretwin.sim_worker.scenarios.places import ScenarioPlace, Unplaced
from foretwin.sim_worker.scenarios.roles import (
    ALONG,
    PlannedMeeting,
    StagedActor,
    StagedCase,
    Staging,
)
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

__all__ = ["StagedActor", "StagedCase", "cast", "cast_all"]

_LATERAL_ACCEL_MPS2 = 4.0
"""Cars begin with no more of it: half of what holds them on a dry road."""
_VERGE_M = 4.0
"""Beside the road, where one may still stand or park."""

_Met = dict[tuple[str | float, ...], PlannedMeeting | str]
"""Meetings by actor, its numbers named here, and the ego's speed and shift: all they depend on."""
_MEETS_BY = ("speed_mps", "impact_share", "arrives_after_s")


def cast(
    scenario: Scenario,
    values: Values,
    place: ScenarioPlace,
    *,
    vehicle: VehicleParameters,
    ego_arc_m: float | None = None,
) -> StagedCase | Unplaced:
    """Return one case at one place, or why these values cannot be played there.

    The ego starts `lead_time_s` before the impact with the speed in `values`, later where its lane
    begins later; or at `ego_arc_m` (of base_link on the place's ego path), where that is given.
    """
    return _cast(scenario, values, place, vehicle, ego_arc_m, {})


def cast_all(
    scenario: Scenario,
    cases: Sequence[Values],
    place: ScenarioPlace,
    *,
    vehicle: VehicleParameters,
    ego_arc_m: float | None = None,
) -> tuple[StagedCase | Unplaced, ...]:
    """Return what `cast` does for each case; cases that differ elsewhere share the search."""
    met: _Met = {}
    return tuple(_cast(scenario, values, place, vehicle, ego_arc_m, met) for values in cases)


def _cast(
    scenario: Scenario,
    values: Values,
    place: ScenarioPlace,
    vehicle: VehicleParameters,
    ego_arc_m: float | None,
    met: _Met,
) -> StagedCase | Unplaced:
    # A car that stands sets off.
    speed = values[f"{EGO}.speed_mps"] or LEAST_START_MPS
    shift = values[f"{EGO}.lateral_shift_m"]
    ego = ego_box(vehicle, place.ego.path, speed, shift, reverse=place.reverse)
    staging = Staging(scenario, values, place, ego)
    meetings: dict[str, PlannedMeeting] = {}
    for part, ways in zip(scenario.actors, place.actor_ways, strict=True):
        if part.relation in ALONG:
            continue
        numbers = [staging.number(part, name) for name in _MEETS_BY]
        key: tuple[str | float, ...] = (part.name, *numbers, ego.speed_mps, ego.offset_m)
        if key not in met:
            met[key] = meet(part, ways, staging, ego_arc_m)
        found = met[key]
        if isinstance(found, str):
            return Unplaced(place.junction_id, found, True)
        meetings[part.name] = found
    start = _start_arc(staging, meetings) if ego_arc_m is None else ego_arc_m
    staging = staging._replace(start_m=start)
    actors = tuple(
        incoming(part, staging, meetings[part.name])
        if part.name in meetings
        else beside_bay(part, staging, ways[0])
        if place.reverse and part.conduct == "parked" and ways
        else along(part, staging, meetings)
        for part, ways in zip(scenario.actors, place.actor_ways, strict=True)
    )
    touched, other = _first_touched(staging, actors, meetings)
    reason = (
        _out_of_time(staging, meetings)
        or _out_of_bounds(staging, actors, touched.time_s)
        or _in_the_way(staging, actors, other)
    )
    if reason:
        return Unplaced(place.junction_id, reason, True)
    way = place.ego
    off = [max(0.0, way.first_m - start)] if ego_arc_m is None else [0.0]
    off += [
        max(0.0, meetings[actor.name].way.first_m - actor.start_arc_m)
        for actor in actors
        if actor.name in meetings
    ]
    return StagedCase(
        place,
        values,
        actors,
        ego_arc_m=start,
        ego_lateral_m=ego.offset_m,
        ego_speed_mps=speed,
        impact_time_s=touched.time_s,
        impact_point_m=touched.point_m,
        impact_share=touched.share,
        impact_with=other,
        off_lanes_m=max(off),
        meets_s=touched.time_s if other else _meets_s(staging, meetings),
    )


def _start_arc(staging: Staging, meetings: dict[str, PlannedMeeting]) -> float:
    """Return where base_link starts: so long before the impact, or the junction, as is meant.

    It starts later where its lane begins later, or that of who meets it, or where it would begin in
    a bend that is too tight for its speed.
    """
    scenario, place, ego = staging.scenario, staging.place, staging.ego
    end, time_s = place.ego.entry_m - staging.ego.front_m, scenario.lead_time_s
    for part in scenario.actors:
        if part.name in meetings:
            impact, way = meetings[part.name]
            end = impact.ego_arc_m
            room_m = impact.actor_arc_m - way.first_m - KINDS[part.kind].length_m / 2.0
            late_s = staging.number(part, "arrives_after_s")
            time_s = min(time_s, room_m / max(staging.number(part, "speed_mps"), 1e-6) - late_s)
            break
        if part.relation == "ahead" and not place.reverse:
            time_s = closing_time_s(part, staging, end) or time_s
            break
    room_s = (end - place.ego.first_m - staging.ego.length_m) / ego.speed_mps
    start = end - ego.speed_mps * max(min(time_s, room_s), 2 * LEAST_TIME_S)
    return _past_bend(ego, start, end - 2 * LEAST_TIME_S * ego.speed_mps)


def _past_bend(ego: MovingBox, start_m: float, latest_m: float) -> float:
    """Return where a bend ends that is too tight to begin in; else the start itself."""
    arcs = np.arange(start_m, latest_m, 1.0)
    curvature = ego.path.at_nodes(ego.path.curvature_pm, arcs)
    free = np.abs(curvature) * ego.speed_mps**2 <= _LATERAL_ACCEL_MPS2
    return float(arcs[free.argmax()]) if free.any() else start_m


def _first_touched(
    staging: Staging, actors: tuple[StagedActor, ...], meetings: dict[str, PlannedMeeting]
) -> tuple[Touched, str]:
    """Return the planned touch and the name of the other; NaN where none is planned."""
    for part in staging.scenario.actors:
        if part.name in meetings and staging.number(part, "arrives_after_s") == 0.0:
            impact = meetings[part.name].impact
            time_s = (impact.ego_arc_m - staging.start_m) / staging.ego.speed_mps
            return Touched(time_s, impact.point_m, impact.share), part.name
    for actor in actors:
        if actor.relation in ("ahead", "parked") and not staging.place.reverse:
            found = run_into(actor, staging)
            if found is not None:
                return found, actor.name
    return Touched(math.nan, np.full(2, math.nan), math.nan), ""


def _meets_s(staging: Staging, meetings: dict[str, PlannedMeeting]) -> float:
    """Return when the ego is where it would meet the first of those who are early or late."""
    for part in staging.scenario.actors:
        if part.name in meetings:
            return (meetings[part.name].impact.ego_arc_m - staging.start_m) / staging.ego.speed_mps
    return math.nan


def _out_of_time(staging: Staging, meetings: dict[str, PlannedMeeting]) -> str:
    """Return who is so early or late that it has passed the place of meeting as the case begins, or
    is not there as it ends, or nothing."""
    end_s = staging.scenario.horizon_s
    for part in staging.scenario.actors:
        late_s = staging.number(part, "arrives_after_s")
        if part.name not in meetings or late_s == 0.0:
            continue
        impact = meetings[part.name].impact
        there_s = (impact.ego_arc_m - staging.start_m) / staging.ego.speed_mps + late_s
        told = f"{part.name}, with arrives_after_s {late_s:g}, would be at the place of meeting"
        if there_s < 0.0:
            return f"{told} {-there_s:.1f} s before the start"
        if there_s > end_s:
            return f"{told} after {there_s:.1f} s, after the end at {end_s:g} s"
    return ""


def _in_the_way(staging: Staging, actors: tuple[StagedActor, ...], met: str) -> str:
    """Return who parks where the ego must pass, or in a building, or nothing."""
    for actor in actors:
        stands = actor.relation == "parked" and actor.name != met
        stands |= staging.place.reverse and actor.conduct == "parked"
        if stands and stands_in_the_way(actor, staging):
            return f"{actor.name} would stand in the ego's way"
        if actor.conduct == "parked" and stands_in_a_building(actor, staging):
            return f"{actor.name} would stand in a building"
    if backs_into_a_building(staging):
        return "the ego would touch a building on its way into the bay"
    return ""


def _out_of_bounds(staging: Staging, actors: tuple[StagedActor, ...], time_s: float) -> str:
    """Return what makes a case impossible to play, or nothing."""
    end_s = staging.scenario.horizon_s
    if time_s > end_s:
        return f"the impact would be in {time_s:.1f} s, after the end at {end_s:g} s"
    left, right = staging.place.edges_m
    for actor in actors:
        if not right - _VERGE_M <= actor.lateral_m <= left + _VERGE_M:
            return (
                f"{actor.name} would be {abs(actor.lateral_m):.1f} m beside the ego's path, off "
                f"the road, which reaches {left if actor.lateral_m > 0.0 else -right:.1f} m there"
            )
    return ""
