"""Which roads a car may be on after it has moved, and what speaks against each.

A hidden Markov model after Newson and Krumm (2009), "Hidden Markov map matching through noise and
sparseness": a candidate road is likely where it is near and runs the car's way, and where driving
to it from the last candidate is as long as the car has moved. Forbidden ground (pedestrian
streets, one-way streets the wrong way) costs more but is allowed, since maps age.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from foretwin.orchestrator.routing.road_index import (
    NearEdge,
    Reached,
    RoadIndex,
    legality,
)
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey

SEARCH_RADIUS_M = 40.0
BEGIN_RADIUS_M = 25.0
"""A match begins within this distance, and ends beyond it after a while."""
STEP_M = 2.0
"""A car that has moved less has taken no step."""
_SIGMA_M = 6.0
# How strongly each disagreement speaks against a road, as negative log likelihood. The weights of a
# step grow with the way driven since the last one, up to `_INDEPENDENT_M`, since fixes near each
# other err alike; so the result does not depend on the rate of the fixes.
_INDEPENDENT_M = 10.0
_HEADING = 3.0
_AGAINST = {"car": 0.0, "no_car_road": 0.4, "against_one_way": 1.5}
_DETOUR_PER_M = 0.2
_U_TURN = 8.0
_TELEPORT = 14.0
_KEEP_WITHIN = 18.0
_KEEP_AT_MOST = 10


class Hypothesis(NamedTuple):
    """One road the car may be on, with what speaks against it and how it came there.

    `parent` indexes the hypotheses of the step before; `via` are the edges driven through since
    then; `connected` is false where no way leads here from there.
    """

    near: NearEdge
    cost: float
    parent: int
    via: tuple[DirectedEdge, ...]
    connected: bool


def emission(near: NearEdge, yaw_rad: float | None, moved_m: float) -> float:
    """Return what speaks against a candidate by itself."""
    cost = 0.5 * (near.distance_m / _SIGMA_M) ** 2
    if yaw_rad is not None:
        cost += _HEADING * (1.0 - math.cos(near.heading_rad - yaw_rad))
    cost += _AGAINST[legality(near.directed_edge)]
    return cost * min(1.0, moved_m / _INDEPENDENT_M)


def first_hypotheses(candidates: Sequence[NearEdge], yaw_rad: float | None) -> list[Hypothesis]:
    """Return the hypotheses of a beginning: every candidate by itself, best first."""
    fresh = [
        Hypothesis(near, emission(near, yaw_rad, _INDEPENDENT_M), -1, (), False)
        for near in candidates
    ]
    return _best(fresh)


def next_hypotheses(
    index: RoadIndex,
    before: Sequence[Hypothesis],
    candidates: Sequence[NearEdge],
    yaw_rad: float | None,
    moved_m: float,
) -> list[Hypothesis]:
    """Return the hypotheses after the car has moved by `moved_m`, best first, least cost 0."""
    limit_m = 2.0 * moved_m + 40.0
    reached = [index.reached(old.near.directed_edge, limit_m=limit_m) for old in before]
    fresh: list[Hypothesis] = []
    for near in candidates:
        own = emission(near, yaw_rad, moved_m)
        best = Hypothesis(near, math.inf, -1, (), False)
        for parent, old in enumerate(before):
            arrival = _transition(old.near, near, reached[parent], moved_m)
            if old.cost + arrival.cost < best.cost:
                best = Hypothesis(
                    near, old.cost + arrival.cost, parent, arrival.via, arrival.connected
                )
        fresh.append(best._replace(cost=best.cost + own))
    return _best(fresh)


class _Arrival(NamedTuple):
    cost: float
    via: tuple[DirectedEdge, ...]
    connected: bool


def _transition(
    old: NearEdge,
    new: NearEdge,
    reached: Mapping[EdgeKey, Reached],
    moved_m: float,
) -> _Arrival:
    """Return the cheapest way from one candidate to the next."""
    options = [_Arrival(_TELEPORT, (), False)]
    old_edge, new_edge = old.directed_edge, new.directed_edge
    if old_edge.edge.index == new_edge.edge.index:
        if old_edge.reverse == new_edge.reverse:
            ahead = new.s_m - old.s_m
            # Noise moves a slow car backwards by a metre or two; more than that is another lap.
            if ahead > -5.0:
                options.append(_Arrival(_DETOUR_PER_M * abs(max(ahead, 0.0) - moved_m), (), True))
        else:
            options.append(_Arrival(_U_TURN, (), True))
    found = reached.get(new_edge.key)
    if found is not None:
        rest_m = max(0.0, old_edge.edge.length_m - old.s_m)
        driven_m = rest_m + found.gap_m + new.s_m
        effort_m = rest_m + found.effort_m + new.s_m
        cost = _DETOUR_PER_M * (abs(driven_m - moved_m) + (effort_m - driven_m) * 0.2)
        options.append(_Arrival(cost, found.via, True))
    return min(options, key=lambda option: option.cost)


def _best(hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    # `sorted` is stable and candidates come in a fixed order, so ties do not depend on chance.
    ordered = sorted(hypotheses, key=lambda hypothesis: hypothesis.cost)
    least = ordered[0].cost
    return [
        hypothesis._replace(cost=hypothesis.cost - least)
        for hypothesis in ordered[:_KEEP_AT_MOST]
        if hypothesis.cost - least <= _KEEP_WITHIN
    ]
