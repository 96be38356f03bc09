"""How far from a place lanes must end so that its turns are as wide as corners are built.

Corners come from printed norms. AASHTO, A Policy on Geometric Design of Highways and Streets
("Edge-of-traveled-way designs for turns at intersections", passenger cars) has their radius by how
far is turned, FGSV, RASt 06, p. 123, by whether a main road is left or reached, FHWA's PEDSAFE that
of residential streets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import Flags, cross, left_of, turn_rad, units
from foretwin.geometry.polyline_batch import Polylines, points_at, without_repeats
from foretwin.geometry.turn_curves import REACH_PER_RADIUS
from foretwin.world_gen.countries.rules import rules_of
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.lane_plans import CrossSection
from foretwin.world_gen.lanes.legs import is_ring_edge
from foretwin.world_gen.roads.road_classes import road_class

CORNER_AT_RAD = np.radians([30.0, 45.0, 60.0, 75.0, 90.0, 120.0, 135.0, 150.0, 180.0])
CORNER_M = np.array([18.0, 15.0, 12.0, 11.0, 9.0, 6.0, 6.0, 5.5, 4.5])
"""Radius of the edge of the road by how far is turned: AASHTO, passenger cars; from memory,
not held against a copy of the table."""
LEAVING_SHARE, ALIKE_SHARE, REACHING_SHARE = 12.0 / 9.0, 10.0 / 9.0, 8.0 / 9.0
"""Of it out of a main road, between roads alike, and into one: RASt's 12 and 8 m at a right angle,
and between them. Between a main road and another it is the country's."""
MINOR_SHARE = 4.6 / 9.0
"""Of it between other roads, and into rings: PEDSAFE's 15 ft at a right angle."""
MAIN_IMPORTANCE = 4.0
"""Of tertiary roads, the least main ones. Where there are lights all roads are main ones."""
USUAL_LANE_M = 3.25
SOFTEST_TURN_RAD, SHARPEST_TURN_RAD = math.radians(20.0), math.radians(150.0)
HAIRPIN_RAD, BEND_RAD = math.radians(135.0), math.radians(20.0)
"""Lanes end before their road bends by so much, where they would turn by so much from behind it:
such a path swings out beside both roads (to AASHTO's 135° corners grow tighter, then no more)."""
SHARPEST_ARC_RAD = math.radians(140.0)
"""Sharper turns swing out instead of beginning farther back."""
_ROUNDS = 2
_LOOK_M = 2.0
_LEAST_SIN = 0.2


class _Legs(NamedTuple):
    """The legs of K clusters that have n legs each; (K, n) or (K, n, 2) arrays."""

    ways: Polylines
    into_m: Array
    """How far the outermost lanes toward the place lie to their drivers' left and right."""
    out_m: Array
    half_lane_m: Array
    importance: Array
    main: Flags
    mixed_share: Array
    """(K,) of that radius between a main road and another."""
    ring: Flags


def turning_trims(
    clusters: list[Cluster], sections: Mapping[int, CrossSection], least_m: Array, most_m: Array
) -> Array:
    """Return metres (K, n) cut off the legs of clusters that have n legs each.

    They are `least_m` (K, n), or more where lanes that ended there were too near to one another to
    turn; at most `most_m` (K, n). A turn by an angle with radius R begins R tan(angle / 2) before
    the lanes' lines cross, and farther for the way in which its curvature rises.
    """
    legs = _legs_of(clusters, sections)
    most_m = np.maximum(most_m, least_m)
    wide_m = _widened_m(legs, least_m, most_m)
    bend_m = np.minimum(_bends_at_m(legs, least_m), most_m)
    before, behind = (_turned_rad(legs, m) for m in (np.minimum(wide_m, bend_m), wide_m))
    swings_out = ((behind > HAIRPIN_RAD) & (before < HAIRPIN_RAD)).any(axis=2)
    if not swings_out.any():
        return wide_m
    return _widened_m(legs, least_m, np.where(swings_out, bend_m, most_m))


def _widened_m(legs: _Legs, least_m: Array, most_m: Array) -> Array:
    trim = least_m
    for _ in range(_ROUNDS):
        trim = np.clip(trim + _missing_m(legs, trim), least_m, most_m)
    return np.asarray(trim)


def _legs_of(clusters: list[Cluster], sections: Mapping[int, CrossSection]) -> _Legs:
    legs = [leg for cluster in clusters for leg in cluster.legs]
    into = [sections[leg.edge.index].along(reverse=not leg.reverse) for leg in legs]
    out = [sections[leg.edge.index].along(reverse=leg.reverse) for leg in legs]
    shape = (len(clusters), len(clusters[0].legs))
    width = [
        (a.driven or b.driven)[-1:]
        if leg.edge.driving_side == "right"
        else (a.driven or b.driven)[:1]
        for leg, a, b in zip(legs, into, out, strict=True)
    ]
    lit = [c.junction is not None and c.junction.summary.control == "signals" for c in clusters]
    importance = np.array([_importance(leg.edge.road_class) for leg in legs]).reshape(shape)
    mixed_m = [rules_of(c.legs[0].edge.country).mixed_corner_m for c in clusters]
    return _Legs(
        ways=without_repeats(Polylines.of([leg.xy_m for leg in legs])),
        into_m=np.array([lanes.reach_m for lanes in into]).reshape(*shape, 2),
        out_m=np.array([lanes.reach_m for lanes in out]).reshape(*shape, 2),
        half_lane_m=np.array(
            [plans[0].width_m.value / 2 if plans else USUAL_LANE_M / 2 for plans in width]
        ).reshape(shape),
        importance=importance,
        main=(importance >= MAIN_IMPORTANCE) | np.array(lit)[:, None],
        mixed_share=np.array(mixed_m) / 9.0,
        ring=np.array([is_ring_edge(leg.edge) for leg in legs]).reshape(shape),
    )


def _importance(name: str) -> float:
    """Return the rank of a class of roads; slip roads have that of the least main road."""
    rank = road_class(name).importance
    return max(rank, MAIN_IMPORTANCE) if name.endswith("_link") else rank


def _bends_at_m(legs: _Legs, from_m: Array) -> Array:
    """Return how far along (K, n) legs bend next beyond `from_m`; inf where they do not."""
    ways, line = legs.ways, legs.ways.line
    _, head = _ends(legs, from_m)
    bent = np.abs(turn_rad(head.reshape(-1, 2)[line], ways.steps[0])) > BEND_RAD
    bent &= ~ways.is_last & (ways.arc_m > from_m.ravel()[line])
    found = np.minimum.reduceat(np.where(bent, ways.arc_m, np.inf), ways.first[:-1])
    return np.asarray(found.reshape(from_m.shape))


def _ends(legs: _Legs, trim: Array) -> tuple[Array, Array]:
    """Return where legs that are cut begin, and their directions there, both (K, n, 2)."""
    which = np.arange(trim.size)
    at_m = np.minimum(trim.ravel(), legs.ways.length_m - _LOOK_M)
    at = points_at(legs.ways, which, at_m).reshape(*trim.shape, 2)
    ahead = points_at(legs.ways, which, at_m + _LOOK_M).reshape(*trim.shape, 2)
    return at, units(ahead - at)


def _turned_rad(legs: _Legs, trim: Array) -> Array:
    """Return by how much who comes from one leg turns into another, (K, n, n)."""
    _, head = _ends(legs, trim)
    return np.abs(turn_rad(-head[:, :, None], head[:, None, :]))


def _missing_m(legs: _Legs, trim: Array) -> Array:
    """Return how much farther back (K, n) lanes must end, negative where there is room to spare."""
    at, head = _ends(legs, trim)
    # From leg i into leg j; an angle above 0 is a turn to the left.
    own, other = head[:, :, None], head[:, None, :]
    angle = turn_rad(-own, other)
    size, left = np.abs(angle), angle > 0.0
    start = np.where(left, -legs.into_m[:, :, None, 0], legs.into_m[:, :, None, 1])
    end = np.where(left, -legs.out_m[:, None, :, 0], legs.out_m[:, None, :, 1])
    # To the right of who drives in, and to the left of who drives out.
    aside = left_of(head)
    gap = at[:, None, :] - at[:, :, None]
    gap = gap - end[..., None] * aside[:, None, :] - start[..., None] * aside[:, :, None]
    sin = cross(own, other)
    across = np.where(np.abs(sin) < _LEAST_SIN, np.copysign(_LEAST_SIN, sin), sin)
    back_m, on_m = cross(gap, other) / across, cross(gap, own) / across
    room = _radius_m(legs, size) * REACH_PER_RADIUS
    room = room * np.tan(np.minimum(size, SHARPEST_ARC_RAD) / 2.0)
    turns = (size > SOFTEST_TURN_RAD) & (size < SHARPEST_TURN_RAD)
    back_m = np.where(turns & np.isfinite(back_m), back_m + room, -np.inf)
    on_m = np.where(turns & np.isfinite(on_m), on_m + room, -np.inf)
    return np.asarray(np.maximum(back_m.max(axis=2), on_m.max(axis=1)))


def _radius_m(legs: _Legs, size: Array) -> Array:
    """Return the radius (K, n, n) of a car's way round each corner, in the middle of its lane."""
    own, other = legs.importance[:, :, None], legs.importance[:, None, :]
    share = np.where(own > other, LEAVING_SHARE, REACHING_SHARE)
    share = np.where(own == other, ALIKE_SHARE, share)
    mains = legs.main[:, :, None].astype(int) + legs.main[:, None, :]
    mains[legs.ring.any(axis=1)] = 0
    share = np.choose(mains, [MINOR_SHARE, legs.mixed_share[:, None, None], share])
    lane_m = np.maximum(legs.half_lane_m[:, :, None], legs.half_lane_m[:, None, :])
    return np.asarray(np.interp(size, CORNER_AT_RAD, CORNER_M) * share + lane_m)
