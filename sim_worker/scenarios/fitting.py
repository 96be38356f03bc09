"""Whether a case fits the roads that it was cast on: speeds, run-ups, and who crosses whom."""

from __future__ import annotations

import math

import numpy as np

from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.scenario import EGO, ActorPart, EgoPart, Scenario
from foretwin.sim_worker.scenarios.drawing import Values
from foretwin.sim_worker.scenarios.places import ScenarioPlace
from foretwin.sim_worker.scenarios.roles import ALONG, StagedActor, StagedCase
from foretwin.sim_worker.scenarios.ways import Way

LEAST_RUN_UP_S = 2.5
"""On lanes before an impact: what a driver takes to perceive and react (AASHTO Green Book, 2018,
3.2.2)."""
EGO_OVER_LIMIT, OTHERS_OVER_LIMIT = 1.1, 1.5
"""Of a road's limit: the ego drives as people ordinarily do, others may be what goes wrong. Chosen;
beyond 1.5 a road of 30 km/h would carry what is driven on main roads."""
_CROSS_RAD, _SQUARE_RAD = math.radians(20.0), math.radians(50.0)
"""Cars whose headings differ by less as they meet do not cross; where both go straight on, neither
do those that meet within so much of the same or the opposite heading. Chosen."""
_ASIDE_M, _BEYOND_M = 1.5, 5.0
"""So far on either side of the ego's way is who crosses it, so far from the junction."""
_APPROACH_M, _OFF_LANES_M = 40.0, 1.0
_NO_WALKING = frozenset(("motorway", "motorway_link"))
_SLOW = frozenset(("pedestrian", "bicycle"))
_QUARTERS = {"straight": 0, "across": 1, "near": -1}
_FROM = {"from_near": 1, "oncoming": 2, "from_across": -1}
"""Quarters of a turn to the left, where traffic keeps right: turns, and where others come from."""


def not_for(scenario: Scenario, values: Values, place: ScenarioPlace) -> str:
    """Return why a case is not for the roads of a place, or nothing: who would be too fast there,
    or walk or park on a motorway."""
    if place.reverse:
        return ""
    if motorways := _NO_WALKING.intersection(place.road_classes):
        for part in scenario.actors:
            if part.kind in _SLOW or part.relation == "parked":
                return f"{part.name} would be on a {min(motorways)}"
    ego_limit = _limit_mps(place.ego)
    if (speed := values[f"{EGO}.speed_mps"]) > EGO_OVER_LIMIT * ego_limit:
        return _too_fast("the ego", speed, ego_limit)
    for part, ways in zip(scenario.actors, place.actor_ways, strict=True):
        speed = values[f"{part.name}.speed_mps"]
        limit = ego_limit if part.relation in ALONG else max(map(_limit_mps, ways), default=np.inf)
        if speed > OTHERS_OVER_LIMIT * limit:
            return _too_fast(part.name, speed, limit)
    return ""


def _limit_mps(way: Way, from_m: float | None = None) -> float:
    """Return the lowest limit of the lanes by which a way comes to its junction, from an arc length
    on, or over the last metres."""
    from_m = max(way.first_m, way.entry_m - _APPROACH_M if from_m is None else from_m)
    nodes = (way.path.arc_m >= from_m) & (way.path.arc_m <= max(way.entry_m - 1.0, from_m))
    at_entry = np.interp(from_m, way.path.arc_m, way.path.speed_limit_mps)
    return float(way.path.speed_limit_mps[nodes].min(initial=float(at_entry)))


def _too_fast(who: str, speed_mps: float, limit_mps: float) -> str:
    return f"{who} would drive {3.6 * speed_mps:.0f} km/h on a road of {3.6 * limit_mps:.0f} km/h"


def unfit(scenario: Scenario, case: StagedCase) -> str:
    """Return why a case that was cast does not fit its roads, or nothing."""
    if reason := not_for(scenario, case.values, case.place):
        return reason
    limit = _limit_mps(case.place.ego, case.ego_arc_m)
    if not case.place.reverse and case.ego_speed_mps > EGO_OVER_LIMIT * limit:
        return _too_fast("the ego", case.ego_speed_mps, limit)
    if case.off_lanes_m > _OFF_LANES_M:
        return "a road is too short for the way up to the impact"
    if reason := ill_timed(scenario, case):
        return reason
    for part, actor in zip(scenario.actors, case.actors, strict=True):
        if part.name == case.impact_with and crosses(scenario.ego, part):
            both_straight = scenario.ego.turn == part.turn == "straight"
            return _beside_each_other(case, actor, both_straight=both_straight)
    return ""


def ill_timed(scenario: Scenario, case: StagedCase) -> str:
    """Return that an impact comes too soon for anybody to react, or after the end, if it does."""
    if case.impact_with and case.impact_time_s < LEAST_RUN_UP_S:
        return f"a road leaves less than {LEAST_RUN_UP_S:g} s before the impact"
    if case.impact_with and case.impact_time_s > scenario.horizon_s:
        return f"the impact would be after the end at {scenario.horizon_s:g} s"
    return ""


def crosses(ego: EgoPart, part: ActorPart) -> bool:
    """Return whether the ways of the ego and another lead to different arms, and so must cross."""
    if part.relation not in _FROM:
        return False
    return (_FROM[part.relation] + _QUARTERS[part.turn] - _QUARTERS[ego.turn]) % 4 != 0


def _beside_each_other(case: StagedCase, actor: StagedActor, *, both_straight: bool) -> str:
    """Return that two cars do not cross, where they do not."""
    ego, way = case.place.ego, case.place.way_named(actor.way)
    met_m = np.array([case.ego_arc_m + case.ego_speed_mps * case.impact_time_s])
    actor_m = actor.moving(way.path).arc_after(actor.start_on(way), np.array([case.impact_time_s]))
    yaw = ego.path.yaw_at(met_m), way.path.yaw_at(actor_m)
    turned = abs(float(wrap_angle(yaw[0] - yaw[1])[0]))
    if turned < _CROSS_RAD or (both_straight and math.sin(turned) < math.sin(_SQUARE_RAD)):
        return f"{actor.name} would meet the ego along its way, not across it"
    ends = way.path.point_at(np.array([way.entry_m - _BEYOND_M, way.exit_m + _BEYOND_M]))
    before, after = ego.path.locate(ends).offset_m
    if before * after >= 0.0 or min(abs(before), abs(after)) < _ASIDE_M:
        return f"{actor.name} does not cross the ego's way: the two merge"
    return ""
