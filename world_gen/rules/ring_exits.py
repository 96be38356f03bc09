"""Lights on the roads out of a signalled ring: they change with the ring's, in one plan."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import msgspec

from foretwin.contracts.signals import SignalGroup, SignalPhase, SignalPlan
from foretwin.geometry.polyline import arc_lengths
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.legs import is_ring_edge
from foretwin.world_gen.roads.road_graph import DirectedEdge
from foretwin.world_gen.rules.lone_lights import LoneLights, group_names

EXIT_WITHIN_M = 50.0
"""Who is held back nearer to a ring stands on it before long: one controller serves both."""


class RingPlans(NamedTuple):
    """The plans of junctions by id, and the lights that stay alone."""

    plans: Mapping[str, SignalPlan]
    lone: LoneLights


def with_ring_exits(
    plans: Mapping[str, SignalPlan], lone: LoneLights, around: Surroundings
) -> RingPlans:
    """Return plans in which the lights on the roads out of a ring have joined those of the ring.

    Cars drive out in all phases but the longest, in which those on foot cross.
    """
    rings: dict[str, list[Cluster]] = defaultdict(list)
    for cluster in around.clusters:
        if cluster.ring and cluster.junction is not None and cluster.junction.summary.id in plans:
            rings[cluster.junction.summary.id].append(cluster)
    if not rings or not lone.plans:
        return RingPlans(plans, lone)
    alone = {plan.groups[0].id: plan for plan in lone.plans}
    plain_from = {leg.start_node: c for c in around.clusters if c.plain for leg in c.legs}
    renamed: dict[str, str] = {}
    joined = dict(plans)
    for name, of_ring in rings.items():
        exits = [
            alone[drive]
            for node in dict.fromkeys(_lights_out(of_ring, plain_from))
            if (drive := group_names(node)[0]) in alone and drive not in renamed
        ]
        if exits:
            joined[name], names = _joined(name, plans[name], exits)
            renamed |= names
    kept = tuple(plan for plan in lone.plans if plan.groups[0].id not in renamed)
    signals = tuple(
        msgspec.structs.replace(s, group_id=renamed.get(s.group_id, s.group_id))
        for s in lone.signals
    )
    return RingPlans(joined, LoneLights(lone.stop_lines, signals, kept))


def _joined(
    name: str, plan: SignalPlan, exits: list[SignalPlan]
) -> tuple[SignalPlan, dict[str, str]]:
    """Return a ring's plan with those of its exits, and their groups' new names by the old."""
    theirs = [group for its in exits for group in its.groups]
    names = {g.id: f"{name}:g{i}" for i, g in enumerate(theirs, start=len(plan.groups))}
    groups = [msgspec.structs.replace(g, id=names[g.id]) for g in theirs]
    walked = max(range(len(plan.phases)), key=lambda i: plan.phases[i].green_s)

    def green(group: SignalGroup, phase: int) -> bool:
        return bool(group.crossing_ids) == (phase == walked)

    phases = tuple(
        SignalPhase(
            green_s=phase.green_s,
            green_group_ids=(*phase.green_group_ids, *(g.id for g in groups if green(g, i))),
        )
        for i, phase in enumerate(plan.phases)
    )
    return msgspec.structs.replace(plan, groups=(*plan.groups, *groups), phases=phases), names


def _lights_out(ring: Iterable[Cluster], plain_from: Mapping[int, Cluster]) -> Iterator[int]:
    """Yield the nodes of the roads that lead out of a ring, as far as its lights may stand."""
    for cluster in ring:
        for leg in cluster.legs:
            if leg.allowed and not is_ring_edge(leg.edge):
                yield from _nodes_along(leg, plain_from)


def _nodes_along(leg: DirectedEdge, plain_from: Mapping[int, Cluster]) -> Iterator[int]:
    gone_m = 0.0
    while gone_m < EXIT_WITHIN_M:
        along_m = gone_m + arc_lengths(leg.xy_m)
        for node, at_m in zip(leg.node_ids, along_m.tolist(), strict=False):
            if at_m <= EXIT_WITHIN_M:
                yield node
        gone_m = float(along_m[-1])
        behind = plain_from.get(leg.end_node)
        onward = [d for d in behind.legs if d.edge.index != leg.edge.index] if behind else []
        if not onward or not onward[0].allowed:
            return
        leg = onward[0]
