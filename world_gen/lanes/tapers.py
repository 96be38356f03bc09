"""Lanes that open, close or lie aside where one road goes on: what they give way for it."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.lanes.legs import Heads, lateral_positions
from foretwin.world_gen.lanes.stopping import NodeTags, before_crossings_m, must_reach_m
from foretwin.world_gen.roads.headings import dot
from foretwin.world_gen.roads.road_graph import EdgeKey

TAPER_M = 6.0
"""Lanes end so far before, and begin so far behind, a place where their number changes."""
SAME_PLACE_M = 0.01
"""Lanes whose middles part less run on into each other: it is what widths add up to."""
SHARPEST_BEND_COS = math.cos(math.radians(75.0))
"""Lanes run on through bends; sharper ones are driven as turns."""
MAX_TRIM_M = 30.0
"""No end of a road gives way farther."""
TAPER_PER_SHIFT = 7.0
"""So many times as long as lanes shift to the side is what lies between their ends, where roads
have room for it: paths then turn from their lanes by 15°, a smoothest shift by 15/8 of its mean
slope (Flash and Hogan 1985)."""
STEEPEST_PER_SHIFT = 4.0
"""At the least, where roads are so short that it takes more of them: paths turn by 25°."""
TAPER_SHARE, MOST_WANTED = 0.3, 0.6
"""Shares of an edge: that one taper may take where it gets not too steep by it, and that two ends
may take for turns, and tapers, to be wider."""


def plain_trims(
    cluster: Cluster,
    sections: Mapping[int, CrossSection],
    shifts_m: Mapping[int, tuple[float, float]],
    heads: Heads,
) -> Array | None:
    """Return what both legs give way at the least, (2,); None where their lanes run on."""
    before, behind = _positions(cluster, sections, shifts_m)
    fits = len(before) == len(behind) and np.allclose(before, behind, rtol=0.0, atol=SAME_PLACE_M)
    fits = fits and cluster.keeps_widths(sections)
    if fits and -dot(*(heads[leg.key] for leg in cluster.legs)) > SHARPEST_BEND_COS:
        return None
    room = (0.0 if fits else min(TAPER_M, TAPER_SHARE * leg.edge.length_m) for leg in cluster.legs)
    return np.array(list(room))


def tapers_m(
    cluster: Cluster,
    sections: Mapping[int, CrossSection],
    shifts_m: Mapping[int, tuple[float, float]],
    node_tags: NodeTags,
) -> dict[EdgeKey, float]:
    """Return what the lanes of both legs give way, by leg, so that none has to swerve.

    What one leg has no room for the other one gives.
    """
    before, behind = _positions(cluster, sections, shifts_m)
    shift_m = max(
        _farthest_m(
            np.array([at_m for at_m, along in before if along == driven]),
            np.array([at_m for at_m, along in behind if along == driven]),
        )
        for driven in (False, True)
    )

    def given_m(length_m: float, share: float) -> list[float]:
        rooms_m = [
            min(
                share * leg.edge.length_m,
                must_reach_m(leg, cluster, sections, node_tags),
                before_crossings_m(leg, node_tags),
                MAX_TRIM_M,
            )
            for leg in cluster.legs
        ]
        each_m = [min(length_m / 2.0, room_m) for room_m in rooms_m]
        return [
            min(length_m - other_m, room_m)
            for room_m, other_m in zip(rooms_m, each_m[::-1], strict=True)
        ]

    found_m = given_m(TAPER_PER_SHIFT * shift_m, TAPER_SHARE)
    if sum(found_m) < STEEPEST_PER_SHIFT * shift_m:
        found_m = given_m(STEEPEST_PER_SHIFT * shift_m, MOST_WANTED)
    return {leg.key: metres for leg, metres in zip(cluster.legs, found_m, strict=True)}


def _positions(
    cluster: Cluster,
    sections: Mapping[int, CrossSection],
    shifts_m: Mapping[int, tuple[float, float]],
) -> tuple[list[tuple[float, bool]], list[tuple[float, bool]]]:
    """Return where lanes lie before and behind a place where one road goes on, seen along it."""
    before, behind = (
        lateral_positions(
            leg,
            sections[leg.edge.index],
            outward=outward,
            shift_m=shifts_m.get(leg.edge.index, (0.0, 0.0))[int(leg.reverse)],
        )
        for leg, outward in zip(cluster.legs, (False, True), strict=True)
    )
    return before, behind


def _farthest_m(before: Array, behind: Array) -> float:
    """Return how far lanes, from the right, lie aside of those that they pass into."""
    if not (len(before) and len(behind)):
        return 0.0
    if len(before) == len(behind):
        return float(np.abs(before - behind).max())
    gaps = np.abs(before[:, None] - behind)
    return float(max(gaps.min(axis=0).max(), gaps.min(axis=1).max()))
