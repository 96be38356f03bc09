"""Slip roads around the corners of junctions."""

from __future__ import annotations

import math

from foretwin.world_gen.junctions.chains import CarRoads, Chain
from foretwin.world_gen.junctions.grouping import Grouping, JunctionCluster

SLIP_M, RAMP_SLIP_M = 50.0, 120.0
"""Length of a slip road around a corner, by any class and by a link class."""
WIDEST_M, WIDEST_WITH_BARE_ENDS_M = 100.0, 170.0
"""Width of a junction with its slip roads, where they end at branchings of their own or not."""
FLARE_WIDTH_M = 70.0
THINNEST_CORNER_RAD = math.radians(18.0)
SMOOTH_RAD, STRAIGHT_RAD = math.radians(60.0), math.radians(12.0)
_LOOK_M = 15.0
"""How far along a road its direction is taken."""


def add_slips(grouping: Grouping, roads: CarRoads) -> None:
    """Give junctions the ends of the slip roads that cut their corners.

    A slip road leaves a road before the junction and joins another one behind it, both without
    a turn, so that its driver could as well have driven through the junction.
    """
    one_way = [c for chains in roads.chains_from.values() for c in chains if c.one_way]
    slips = [c for c in one_way if c.outward and c.length_m <= _longest_m(c)]
    for slip in sorted(slips, key=lambda chain: (chain.length_m, chain.key)):
        before, behind = grouping.of.get(slip.start), grouping.of.get(slip.end)
        if before is None or behind is None or before is behind:
            continue
        leaving, joining = _angle_leaving(slip, roads), _angle_joining(slip, roads)
        if max(leaving, joining) > SMOOTH_RAD:
            continue
        straight_on = max(leaving, joining) < STRAIGHT_RAD
        limit_m = _longest_m(slip)
        to_corner = _next_clusters(slip.start, slip, limit_m, True, grouping, roads)
        from_corner = _next_clusters(slip.end, slip, limit_m, False, grouping, roads)
        for key, (onward, corner) in to_corner.items():
            xy_m = grouping.xy_m
            if not _is_corner(xy_m[slip.start], xy_m[slip.end], xy_m[onward.end]):
                continue
            if corner is behind and _is_bare(before, roads):
                keys = (slip.key, onward.key)
                grouping.attach(corner, before, keys, widest_m=WIDEST_WITH_BARE_ENDS_M)
                break
            if key in from_corner and corner is not before and corner is not behind:
                _attach_both(slip, onward, from_corner[key][0], straight_on, grouping, roads)
                break
        else:
            back, _ = from_corner.get(id(before), (None, None))
            if back is not None and _is_bare(behind, roads):
                xy_m = grouping.xy_m
                if _is_corner(xy_m[slip.start], xy_m[slip.end], xy_m[back.end]):
                    keys = (slip.key, back.key)
                    grouping.attach(before, behind, keys, widest_m=WIDEST_WITH_BARE_ENDS_M)


def _longest_m(slip: Chain) -> float:
    return RAMP_SLIP_M if slip.link else SLIP_M


def slip_ends(roads: CarRoads) -> dict[int, frozenset[int]]:
    """Return for each end of a slip road the other nodes of the junction that it goes around.

    Where the way around is but three sides between lone branchings, it is plain to which of two
    neighbours an end belongs.
    """
    found: dict[int, set[int]] = {}
    for slip in (chain for chains in roads.chains_from.values() for chain in chains):
        if not (slip.one_way and slip.outward and slip.length_m <= RAMP_SLIP_M and slip.link):
            continue
        if max(_angle_leaving(slip, roads), _angle_joining(slip, roads)) > SMOOTH_RAD:
            continue
        limit_m = max(SLIP_M, slip.length_m)
        after, before = (
            [c for c in roads.chains_from[node] if c.key != slip.key and c.length_m <= limit_m]
            for node in (slip.start, slip.end)
        )
        onward, back = {c.end for c in after if c.outward}, {c.end for c in before if c.inward}
        for corner in (onward & back) - {slip.start, slip.end}:
            found.setdefault(slip.start, set()).update((corner, slip.end))
            found.setdefault(slip.end, set()).update((corner, slip.start))
    return {node: frozenset(others) for node, others in found.items()}


def _attach_both(
    slip: Chain, onward: Chain, back: Chain, straight_on: bool, grouping: Grouping, roads: CarRoads
) -> None:
    """Give the corner between two roads both ends of a slip road."""
    if straight_on:
        # The through road itself: the other two sides are a side road's flare.
        for side in (slip, onward, back):
            grouping.join(side, FLARE_WIDTH_M)
        return
    corner = grouping.of[onward.end]
    for end, side in ((grouping.of[slip.start], onward), (grouping.of[slip.end], back)):
        bare = _is_bare(end, roads)
        widest_m = WIDEST_WITH_BARE_ENDS_M if bare else WIDEST_M
        grouping.attach(corner, end, (slip.key, side.key), widest_m=widest_m, core=not bare)


def _is_bare(cluster: JunctionCluster, roads: CarRoads) -> bool:
    """Tell whether a cluster is but the end of slip roads on a road or its two carriageways."""
    ends = sum(len(roads.chains_from[node]) for node in cluster.nodes)
    return len(cluster.nodes) <= 2 and ends <= 3 + len(cluster.nodes)


def _angle_leaving(slip: Chain, roads: CarRoads) -> float:
    """Return the angle by which the straightest way into a slip road turns."""
    ahead = slip.bearing_rad(_LOOK_M)
    before = [c for c in roads.chains_from[slip.start] if c.inward and c.key != slip.key]
    turns = (c.bearing_rad(_LOOK_M) + math.pi - ahead for c in before)
    return min((abs(math.remainder(turn, math.tau)) for turn in turns), default=math.pi)


def _angle_joining(slip: Chain, roads: CarRoads) -> float:
    """Return the angle by which the straightest way out of a slip road turns."""
    x_m, y_m = slip.point_at(max(0.0, slip.length_m - _LOOK_M))
    end_x_m, end_y_m = slip.point_at(slip.length_m)
    ahead = math.atan2(end_y_m - y_m, end_x_m - x_m)
    behind = [c for c in roads.chains_from[slip.end] if c.outward and c.key != slip.key]
    turns = (c.bearing_rad(_LOOK_M) - ahead for c in behind)
    return min((abs(math.remainder(turn, math.tau)) for turn in turns), default=math.pi)


def _next_clusters(
    node: int, slip: Chain, limit_m: float, onward: bool, grouping: Grouping, roads: CarRoads
) -> dict[int, tuple[Chain, JunctionCluster]]:
    """Return the clusters that can be driven to (or come from) by one short road from a node."""
    found: dict[int, tuple[Chain, JunctionCluster]] = {}
    for chain in roads.chains_from[node]:
        other = grouping.of.get(chain.end)
        drivable = chain.outward if onward else chain.inward
        if chain.key == slip.key or other is None or not drivable or chain.length_m > limit_m:
            continue
        known = found.get(id(other))
        if known is None or chain.length_m < known[0].length_m:
            found[id(other)] = (chain, other)
    return found


def _is_corner(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    """Tell whether three points make a triangle without a very sharp corner."""
    for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
        first = math.atan2(q[1] - p[1], q[0] - p[0])
        second = math.atan2(r[1] - p[1], r[0] - p[0])
        if abs(math.remainder(first - second, math.tau)) < THINNEST_CORNER_RAD:
            return False
    return True
