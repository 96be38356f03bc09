"""A fixed-time plan for each signalised junction: phases, greens, amber and clearing times.

The map does not have the real plan. This one is a default after RiLSA 2015: a cycle of 90 s, of
120 s with more than three phases (2.7.3: at most 120 s), amber 3 s up to 50 km/h, 4 s at 60, 5 s
at 70 (2.4), at least 5 s of green (2.7.4), all red for as long as the last car needs to clear the
ground it shares with the first one of the next phase (2.5): clearing 6 m of car and the way there
at 10 m/s, entering at 40 km/h. Who walks is let go in every phase whose cars stay clear; their
own longer clearing time is not in the plan.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from foretwin.contracts.signals import SignalPhase, SignalPlan
from foretwin.contracts.world import Conflict, YieldRule
from foretwin.world_gen.connections.conflicts import Meetings
from foretwin.world_gen.lanes.legs import is_ring_edge
from foretwin.world_gen.rules.signal_groups import LaneGroup, WalkGroup
from foretwin.world_gen.rules.signal_systems import SignalSystems

CYCLE_S, LONG_CYCLE_S, MANY_PHASES = 90.0, 120.0, 4
LEAST_GREEN_S = 5.0
LEAST_ALL_RED_S = 1.0
_AMBER_S = ((50.0, 3.0), (60.0, 4.0), (math.inf, 5.0))
_CAR_M, _CLEARING_MPS, _ENTERING_MPS = 6.0, 10.0, 40.0 / 3.6
_WALKING_MPS = 1.2
_WAITS: tuple[YieldRule, ...] = ("turn_across", "u_turn")


class Between(NamedTuple):
    """What two groups of a junction are to each other.

    `crossing` where they must never be green together, `waiting` where one turns across the
    other and waits. `clear_s` is how long after the one the other may start.
    """

    crossing: bool
    waiting: bool
    clear_s: float


def signal_plans(
    groups: Mapping[str, Sequence[LaneGroup]],
    walks: Mapping[str, Sequence[WalkGroup]],
    conflicts: Sequence[Conflict],
    met: Meetings,
    systems: SignalSystems,
    *,
    red_amber_s: float = 0.0,
) -> dict[str, SignalPlan]:
    """Return a plan for each junction with groups, by its id; `met` are the conflicts' places.

    Plans of one system have the same phases at the same times, as of one controller.
    `red_amber_s` is how long drivers see red and amber before green, where the country has it.
    """
    of = {c.id: g for mine in groups.values() for g in mine for c in g.connections}
    pairs: dict[tuple[str, str], Between] = {}
    rows = zip(conflicts, met.first_m.tolist(), met.second_m.tolist(), strict=True)
    for conflict, first_m, second_m in rows:
        a, b = of.get(conflict.first_id), of.get(conflict.second_id)
        if a is None or b is None or a is b:
            continue
        waits = conflict.rule in _WAITS and oncoming(a, b)
        key = (a.id, b.id) if a.id < b.id else (b.id, a.id)
        old = pairs.get(key, Between(False, False, 0.0))
        clear_s = max(_clear_s(first_m, second_m), _clear_s(second_m, first_m), old.clear_s)
        pairs[key] = Between(old.crossing or not waits, old.waiting or waits, clear_s)
    found: dict[str, SignalPlan] = {}
    for names in systems.members:
        members = {name: groups[name] for name in names}
        found.update(_plans(members, walks, pairs, systems.follow, red_amber_s))
    return {name: found[name] for name in groups}


def oncoming(a: LaneGroup, b: LaneGroup) -> bool:
    """Return whether the roads of two groups lie opposite each other."""
    return a.approach.opposite == b.approach.key and b.approach.opposite == a.approach.key


def _clear_s(clearing_m: float, entering_m: float) -> float:
    return (clearing_m + _CAR_M) / _CLEARING_MPS - entering_m / _ENTERING_MPS


def _plans(
    members: Mapping[str, Sequence[LaneGroup]],
    walks: Mapping[str, Sequence[WalkGroup]],
    pairs: Mapping[tuple[str, str], Between],
    follow: Collection[tuple[str, str]],
    red_amber_s: float,
) -> dict[str, SignalPlan]:
    """Return the plans of the junctions of one system, most often of one junction alone."""
    groups = [group for mine in members.values() for group in mine]
    phases = _phases(groups, pairs, follow)
    green = {name: _greens_of(mine, phases) for name, mine in members.items()}
    weights = [max(len(group.lanes) for group in phase) for phase in phases]
    least = [LEAST_GREEN_S for _ in phases]

    def one_more(least_s: float, walked: str) -> None:
        weights.append(0)
        least.append(least_s)
        for name, mine in green.items():
            goes_on = name != walked and sum(map(bool, mine)) > 1
            mine.append(list(mine[-1]) if goes_on else [])

    for name in members:
        for walk in walks.get(name, ()):
            free = [mine for mine in green[name] if not walk.against & set(mine)]
            for mine in free:
                mine.append(walk.id)
            if not free:
                one_more(max(LEAST_GREEN_S, _walking_s(walk)), name)
                green[name][-1].append(walk.id)
    if len(weights) == 1:
        # One road alone has a light: the others, or those on foot, need their turn too.
        one_more(2.0 * LEAST_GREEN_S, "")
    amber_s = _amber_s(groups)
    clear_s = max((b.clear_s for b in _within(groups, pairs)), default=0.0)
    # Half seconds; amber is no time to enter, so it counts for clearing only from its end.
    all_red_s = max(LEAST_ALL_RED_S, red_amber_s, math.ceil(2.0 * clear_s) / 2.0)
    cycle_s = CYCLE_S if len(weights) < MANY_PHASES else LONG_CYCLE_S
    greens_s = share_green(weights, least, cycle_s - len(weights) * (amber_s + all_red_s))
    return {
        name: SignalPlan(
            groups=(
                *(group.finished() for group in members[name]),
                *(walk.finished() for walk in walks.get(name, ())),
            ),
            phases=tuple(
                SignalPhase(green_s=green_s, green_group_ids=tuple(mine))
                for green_s, mine in zip(greens_s, green[name], strict=True)
            ),
            amber_s=amber_s,
            all_red_s=all_red_s,
            red_amber_s=red_amber_s,
            source="default",
        )
        for name in members
    }


def _greens_of(mine: Sequence[LaneGroup], phases: Sequence[Sequence[LaneGroup]]) -> list[list[str]]:
    """Return which groups of one junction each phase of its system lets go.

    Where a phase is for the others alone its own last one goes on, unless it has no other.
    """
    known = {group.id for group in mine}
    green = [[group.id for group in phase if group.id in known] for phase in phases]
    if sum(map(bool, green)) > 1:
        for i, names in enumerate(green):
            if not names:
                before = next(green[k] for k in range(i - 1, i - 1 - len(green), -1) if green[k])
                names.extend(before)
    return green


def _within(groups: Sequence[LaneGroup], pairs: Mapping[tuple[str, str], Between]) -> list[Between]:
    names = sorted(group.id for group in groups)
    return [pairs[pair] for pair in combinations(names, 2) if pair in pairs]


def _phases(
    groups: Sequence[LaneGroup],
    pairs: Mapping[tuple[str, str], Between],
    follow: Collection[tuple[str, str]],
) -> list[list[LaneGroup]]:
    """Return groups that are green together: roads that face each other first, then those of the
    next junction to which these lead, on a ring who goes round, and all who enter.

    Where two roads that face each other both have lanes of their own for the turn across, these
    go in a phase of theirs; else who turns across waits.
    """
    turning = [group for group in groups if group.turning]
    protected = {g.id for g in turning if any(oncoming(g, other) for other in turning)}

    def together(a: LaneGroup, b: LaneGroup) -> bool:
        between = pairs.get((a.id, b.id) if a.id < b.id else (b.id, a.id))
        if between is None:
            return True
        guarded = bool(protected & {a.id, b.id})
        return not (between.crossing or (between.waiting and guarded))

    waiting = sorted(groups, key=lambda g: g.turning and g.id in protected)
    found: list[list[LaneGroup]] = []
    while waiting:
        first = waiting[0]
        phase = [first]
        for other in sorted(waiting[1:], key=lambda g: _unlike(first, g, follow)):
            if all(together(other, mine) for mine in phase):
                phase.append(other)
        taken = {group.id for group in phase}
        waiting = [group for group in waiting if group.id not in taken]
        found.append(sorted(phase, key=lambda g: g.id))
    return found


def _unlike(
    a: LaneGroup, b: LaneGroup, follow: Collection[tuple[str, str]]
) -> tuple[bool, bool, bool]:
    """Return what sorts groups by how well they go with another one in a phase."""
    apart = (a.id, b.id) not in follow and (b.id, a.id) not in follow
    rings = [is_ring_edge(group.approach.toward.edge) for group in (a, b)]
    return not oncoming(a, b), apart, rings[0] != rings[1]


def _amber_s(groups: Sequence[LaneGroup]) -> float:
    limit_mps = max(lane.speed_limit_mps.value for g in groups for lane in g.lanes)
    return next(amber_s for kmph, amber_s in _AMBER_S if limit_mps * 3.6 <= kmph + 0.5)


def _walking_s(walk: WalkGroup) -> float:
    begin, end = walk.crossing.line
    return math.ceil(float(np.hypot(*(end - begin))) / _WALKING_MPS)


def share_green(weights: Sequence[float], least_s: Sequence[float], total_s: float) -> list[float]:
    """Return half seconds of green for each phase: its least, and its share of what is left.

    Where `total_s` is too short for all the least ones the cycle grows.
    """
    spare = max(total_s - sum(least_s), 0.0)
    whole = max(sum(weights), 1e-9)
    ends = np.floor(2.0 * np.cumsum([spare * weight / whole for weight in weights]) + 0.5) / 2.0
    extra = np.diff(ends, prepend=0.0)
    return [float(least + more) for least, more in zip(least_s, extra, strict=True)]
