"""Where one-way roads fork and merge: which lanes belong to which branch."""

from __future__ import annotations

import math

from foretwin.contracts.world import DrivingSide
from foretwin.world_gen.connections.movements import Movement
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneDraft
from foretwin.world_gen.lanes.legs import is_ring_edge
from foretwin.world_gen.roads.road_graph import DirectedEdge

_FORK_RAD = math.radians(45.0)


def beside_at_fork(cluster: Cluster, ways: list[Movement], around: Surroundings) -> int:
    """Return the lanes of the branch straight on where a one-way road forks in two, else 0."""
    if cluster.ring or len(cluster.nodes) > 1 or len(cluster.legs) != 3 or len(ways) != 2:
        return 0
    ahead = [m.away for m in ways if m.turn == "straight"]
    soft = all(abs(m.angle_rad) < _FORK_RAD for m in ways)
    if len(ahead) != 1 or not soft or any(_two_way(leg) for leg in cluster.legs):
        return 0
    return len(around.lanes_along(ahead[0]).driven)


def _two_way(leg: DirectedEdge) -> bool:
    return leg.edge.forward and leg.edge.backward


def merges(
    cluster: Cluster, ways: tuple[Movement, ...], driving_side: DrivingSide
) -> list[Movement]:
    """Return the movements of one-way roads that merge into one, from the left, else none.

    Where a road enters a ring its lanes join those of the ring on the outside.
    """
    if cluster.ring:
        onto = [m for m in ways if is_ring_edge(m.away.edge)]
        if len(onto) < 2 or len({m.away.key for m in onto}) > 1:
            return []
        inside_first = sorted(onto, key=lambda m: not is_ring_edge(m.toward.edge))
        return inside_first if driving_side == "right" else inside_first[::-1]
    if len(cluster.nodes) > 1 or any(_two_way(leg) for leg in cluster.legs):
        return []
    if len(ways) < 2 or len({m.away.key for m in ways}) > 1:
        return []
    # Who comes from the left turns left to go along with the others.
    ordered = sorted(ways, key=lambda m: -m.angle_rad)
    return ordered if all(abs(m.angle_rad) < _FORK_RAD for m in ordered) else []


def merged_ends(
    movement: Movement, merging: list[Movement], ends: list[LaneDraft], around: Surroundings
) -> list[LaneDraft]:
    """Return the lanes that are for one of the roads that merge, each of them on its side.

    Lanes to spare go to the road with most lanes, the one that goes on.
    """
    counts = [len(around.lanes_along(m.toward).driven) for m in merging]
    at = merging.index(movement)
    spare = len(ends) - sum(counts)
    if spare > 0:
        most = max(range(len(counts)), key=lambda i: (counts[i], -abs(merging[i].angle_rad)))
        counts[most] += spare
    mine = min(counts[at], len(ends))
    first = min(sum(counts[:at]), len(ends) - mine)
    return ends[first : first + mine]
