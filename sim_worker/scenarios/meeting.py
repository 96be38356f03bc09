"""Actors whose ways cross or join the ego's: where they meet it, and where they start for that."""

from __future__ import annotations

from foretwin.contracts.scenario import ActorPart
from foretwin.sim_worker.scenarios.impact import find_impact
from foretwin.sim_worker.scenarios.roles import PlannedMeeting, StagedActor, Staging, moving_box
from foretwin.sim_worker.scenarios.ways import Way
from foretwin.sim_worker.vehicle.road_user_kinds import KINDS

LEAST_TIME_S = 0.8
"""Nothing is staged that is over sooner."""
_SHARES = (0.5, 0.25, 0.75, 0.0, 1.0)
"""Points of the front to meet where the wished one cannot be met first."""
_AROUND_M, _MOUTH_M = 40.0, 15.0
"""How far from the junction the ego may meet others, and how far behind an arm's mouth."""


def meet(
    part: ActorPart, ways: tuple[Way, ...], staging: Staging, ego_arc_m: float | None
) -> PlannedMeeting | str:
    """Return where and by which way an actor meets the ego, as near the wished share as can be.

    Pedestrians do not come through buildings. Says why, where there is no such way.
    """
    place, ego = staging.place, staging.ego
    low, high = place.ego.entry_m - _AROUND_M, place.ego.exit_m + _AROUND_M
    if place.reverse:
        low, high = place.ego.first_m, place.ego.exit_m
    elif part.relation == "crosses_exit":
        low = place.ego.exit_m - _MOUTH_M
    elif part.relation == "crosses_entry":
        high = place.ego.entry_m + _MOUTH_M
    lead = staging.scenario.lead_time_s
    if ego_arc_m is not None:
        low = max(low, ego_arc_m + ego.speed_mps * LEAST_TIME_S)
        lead = LEAST_TIME_S
    wished = staging.number(part, "impact_share")
    walks = part.relation in ("crosses_exit", "crosses_entry")
    before, after = (2.0, 2.0) if walks else (10.0, 30.0)
    walled = False
    speed = staging.number(part, "speed_mps")
    for share in sorted({wished, *_SHARES}, key=lambda other: abs(other - wished)):
        for way in ways:
            impact = find_impact(
                ego,
                moving_box(part.kind, way.path, speed),
                ego_span=(low, high),
                actor_span=(way.entry_m - before, way.exit_m + after),
                share=share,
                near_sign=place.near_sign,
                lead_time_s=lead,
            )
            if impact is None:
                continue
            if not (walks and _through_walls(part, staging, PlannedMeeting(impact, way))):
                return PlannedMeeting(impact, way)
            walled = True
    if walled:
        return f"{part.name} would have to come through a building"
    return f"no way of {part.name} touches the ego's front before anything else"


def _through_walls(part: ActorPart, staging: Staging, meeting: PlannedMeeting) -> bool:
    """Return whether a building stands on what an actor covers before it meets the ego."""
    if staging.place.walls is None:
        return False
    (_, met_m, *_), way = meeting
    on_the_way_s = staging.scenario.lead_time_s + staging.number(part, "arrives_after_s")
    traits = KINDS[part.kind]
    box = moving_box(part.kind, way.path, staging.number(part, "speed_mps"))
    from_m = float(box.arc_after(met_m, -on_the_way_s)) - traits.length_m / 2.0
    return staging.place.walls.block(way.path, from_m, met_m, width_m=traits.width_m)


def incoming(part: ActorPart, staging: Staging, meeting: PlannedMeeting) -> StagedActor:
    """Return an actor that is at its place of impact when the ego is, or as much later as meant."""
    impact, way = meeting
    until_s = (impact.ego_arc_m - staging.start_m) / staging.ego.speed_mps
    until_s += staging.number(part, "arrives_after_s")
    box = moving_box(part.kind, way.path, staging.number(part, "speed_mps"))
    start = float(box.arc_after(impact.actor_arc_m, -until_s))
    return staging.actor(part, way.xy_m, start, 0.0, way.name)
