"""Which branchings of the road graph are one junction to a driver."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product

from foretwin.world_gen.junctions.chains import CarRoads, Chain, Tags
from foretwin.world_gen.junctions.grouping import Grouping, JunctionCluster
from foretwin.world_gen.junctions.junction_control import facing
from foretwin.world_gen.junctions.slip_roads import LOOK_M, add_slips, slip_ends
from foretwin.world_gen.roads.road_graph import RoadGraph

CLOSE_M = 20.0
"""Branchings so near each other are one junction, staggered perhaps."""
ONE_PLACE_M = 10.0
"""Branchings no farther apart are one junction whatever slip roads end there."""
ISLAND_SIDE_M = 30.0
"""Traffic islands have no longer side."""
MEDIAN_M = 60.0
"""Carriageways of one street are no farther apart where another road crosses them."""
SIGNALLED_M = 45.0
"""Signalled branchings so near each other, with no signal between them, are one junction."""
STAGGER_M = 30.0
"""Side roads to the left and right of a road that meet it so near each other stagger a crossing."""
STRAIGHT_RAD, BESIDE_RAD = math.radians(20.0), math.radians(50.0)
STOP_LINE_M = 30.0
"""Signals stand no farther before the branching that they govern."""
FLARE_M = 80.0
"""Arms of a roundabout part into entry and exit no farther from it."""
_ALONG_COS = 0.64
"""Carriageways of one street, and the ends of one, run along each other within 50 degrees."""
WIDEST_M = 70.0
"""A junction other than a ring is no wider, but for its slip roads."""


def cluster_branchings(
    roads: CarRoads, graph: RoadGraph, node_tags: Mapping[int, Tags]
) -> list[JunctionCluster]:
    """Return the branchings and rings grouped into junctions, by their smallest node id.

    A group may still turn out to be no junction: a street that parts into its carriageways is a
    group with two arms.
    """
    grouping = Grouping(roads, graph.node_xy_m)
    single = [chain for chains in roads.chains_from.values() for chain in chains]
    single = [chain for chain in single if chain.start <= chain.end and chain.start != chain.end]
    single.sort(key=lambda chain: (chain.length_m, chain.key))
    ends = slip_ends(roads)
    for chain in single:
        if chain.length_m > MEDIAN_M:
            break
        if _leads_elsewhere(chain, ends) or _leads_elsewhere(chain, ends, back=True):
            continue
        if (
            chain.length_m <= CLOSE_M
            or _links_carriageways(chain, roads)
            or _in_island(chain, roads)
            or (
                chain.length_m <= SIGNALLED_M
                and not (chain.link and chain.end in ends.get(chain.start, ()))
                and _one_signal(chain, roads, node_tags)
            )
        ):
            grouping.join(chain, WIDEST_M)
        elif _staggers(chain, roads):
            grouping.join(chain, STAGGER_M)
    _add_flares(grouping, roads)
    add_slips(grouping, roads)
    return grouping.clusters()


def _leads_elsewhere(
    chain: Chain, slip_ends: Mapping[int, frozenset[int]], *, back: bool = False
) -> bool:
    """Tell whether a chain leads on from the end of another junction's slip road."""
    start, end = (chain.end, chain.start) if back else (chain.start, chain.end)
    return chain.length_m > ONE_PLACE_M and start in slip_ends and end not in slip_ends[start]


def _links_carriageways(chain: Chain, roads: CarRoads) -> bool:
    """Tell whether a chain leads from one carriageway of a street to the opposite one."""
    sides = (_carriageways(node, chain, roads) for node in (chain.start, chain.end))
    return any(
        name_a == name_b and math.cos(heading_a - heading_b) < -_ALONG_COS
        for (name_a, heading_a), (name_b, heading_b) in product(*sides)
    )


def _carriageways(node: int, besides: Chain, roads: CarRoads) -> Iterator[tuple[str, float]]:
    """Yield (name, heading) of the one-way streets that run straight through a node."""
    others = [chain for chain in roads.chains_from[node] if chain.key != besides.key]
    for into in others:
        if not (into.one_way and into.inward):
            continue
        heading = into.bearing_rad(LOOK_M) + math.pi
        for out in others:
            if out.one_way and out.outward and out.name == into.name:
                ahead = out.bearing_rad(LOOK_M)
                if math.cos(ahead - heading) > _ALONG_COS:
                    yield into.name, ahead


def _in_island(chain: Chain, roads: CarRoads) -> bool:
    """Tell whether a chain is a side of a traffic island: a ring of up to four short chains."""
    if chain.length_m > ISLAND_SIDE_M:
        return False
    waiting = [(chain.end, frozenset({chain.key}))]
    while waiting:
        node, used = waiting.pop()
        for side in roads.chains_from[node]:
            if side.length_m > ISLAND_SIDE_M or side.key in used:
                continue
            if side.end == chain.start:
                return True
            if len(used) < 3:
                waiting.append((side.end, used | {side.key}))
    return False


def _one_signal(chain: Chain, roads: CarRoads, node_tags: Mapping[int, Tags]) -> bool:
    """Tell whether both ends of a chain are signalled and nothing stops a driver in between."""
    ends = (chain.start, chain.end)
    between = (mark for mark in chain.marks if mark.node not in ends)
    if any(mark.tags["highway"] == "traffic_signals" for mark in between):
        return False
    return all(_has_signal(node, chain, roads, node_tags) for node in ends)


def _has_signal(node: int, besides: Chain, roads: CarRoads, node_tags: Mapping[int, Tags]) -> bool:
    if node_tags.get(node, {}).get("highway") == "traffic_signals":
        return True
    into = (c for c in roads.chains_from[node] if c.key != besides.key and c.inward)
    return any(any(facing(chain, STOP_LINE_M, "traffic_signals")) for chain in into)


def _staggers(chain: Chain, roads: CarRoads) -> bool:
    """Tell whether a chain is the piece of a straight road between side roads on both sides."""
    if chain.length_m > STAGGER_M:
        return False
    sides = [_side_road(chain, roads, end) for end in (chain.start, chain.end)]
    return 0.0 not in sides and sides[0] * sides[1] < 0.0


def _side_road(chain: Chain, roads: CarRoads, node: int) -> float:
    """Return on which side of a chain the one road leaves that meets it at an end.

    1 is left and -1 right, seen from the chain's start; 0 where no one road leaves beside a
    straight one.
    """
    at_start = node == chain.start
    others = [other for other in roads.chains_from[node] if other.key != chain.key]
    if len(others) != 2 or any(other.one_way for other in (chain, *others)):
        return 0.0
    ahead = chain.bearing_rad(chain.length_m)
    turns = [math.remainder(other.bearing_rad(LOOK_M) - ahead, math.tau) for other in others]
    along = math.pi if at_start else 0.0
    turns.sort(key=lambda turn: abs(math.remainder(turn - along, math.tau)))
    straight = abs(math.remainder(turns[0] - along, math.tau)) < STRAIGHT_RAD
    beside = abs(math.sin(turns[1])) > math.sin(BESIDE_RAD)
    return math.copysign(1.0, turns[1]) if straight and beside else 0.0


def _add_flares(grouping: Grouping, roads: CarRoads) -> None:
    """Give each ring the nodes where its arms part into entry and exit.

    What a flare leads to is no part of the ring for others: all are found before one is added.
    """
    flares = [
        (node, keys, target)
        for node, chains in roads.chains_from.items()
        if (own := grouping.of.get(node)) is not None and not own.ring
        for keys, target in _parting(chains, grouping)
    ]
    for node, keys, target in flares:
        grouping.attach(target, grouping.of[node], keys)  # refused where it is of a ring by now


def _parting(
    chains: Sequence[Chain], grouping: Grouping
) -> Iterator[tuple[tuple[tuple[int, int], tuple[int, int]], JunctionCluster]]:
    """Yield the pairs of one-way chains that lead to and from one ring, by their keys."""
    to_ring = [
        (chain, target)
        for chain in chains
        if chain.one_way
        and chain.length_m <= FLARE_M
        and (target := grouping.of.get(chain.end)) is not None
        and target.ring
    ]
    for (a, target), (b, other) in combinations(to_ring, 2):
        if other is target and a.outward != b.outward:
            yield (a.key, b.key), target
