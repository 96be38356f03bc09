"""How roads that meet rank by sign, by tag and by class: which drivers wait at the edge."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import DrivingSide, YieldRule
from foretwin.world_gen.roads.headings import heading_out
from foretwin.world_gen.roads.road_classes import road_class
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge

_YARD = 1.0
_NUMBERED, _CLASSIFIED = 4.0, 5.0
"""From tertiary up a road of higher class is usually signed as the one with priority; from
secondary up every junction has signs."""

LOOK_M = 15.0
"""Where a road leads follows from its first metres out of the junction."""
_OPPOSITE_COS = math.cos(math.radians(135.0))


class Rank(IntEnum):
    """Who goes first among those who enter; the higher one."""

    YARD = 0
    """Out of a yard, a track, a living street (StVO §10): waits for all."""
    MINOR = 1
    PLAIN = 2
    PRIORITY = 3


class Standing(NamedTuple):
    """How a road ranks where it meets others, the rule for that, and where it is from."""

    rank: Rank
    rule: YieldRule
    source: Provenance


class Entry(NamedTuple):
    """One road driven toward a junction, as `standings` weighs it.

    `sign` is a stop or give-way sign that is tagged for it, `opposite` the place in the list of
    the road that goes straight on from it. `leads_on` is whether it goes straight on at all, be
    it into a road that leads out alone.
    """

    edge: RoadEdge
    sign: YieldRule | None
    opposite: int | None
    leads_on: bool


def opposites(
    roads: Sequence[DirectedEdge], legs: Sequence[DirectedEdge]
) -> list[tuple[int | None, bool]]:
    """Return for each road in which of them lies straight ahead, and whether any leg does.

    `roads` are driven toward the junction, `legs` out of it; a leg that no car enters by has no
    place among the roads.
    """
    # A junction has few roads: plain floats are faster here than arrays.
    out = [outward(road) for road in roads]
    out_only = [leg for leg in legs if not leg.back.allowed]
    ways_out = [heading_out(leg, LOOK_M) for leg in out_only]
    found: list[tuple[int | None, bool]] = []
    for x, y in out:
        cos = [x * u + y * v for u, v in out]
        lowest = min(cos)
        ahead = cos.index(lowest) if lowest < _OPPOSITE_COS else None
        past = any(x * u + y * v < _OPPOSITE_COS for u, v in ways_out)
        found.append((ahead, past or ahead is not None))
    return found


def outward(toward: DirectedEdge) -> tuple[float, float]:
    """Return the unit direction in which a road in leaves the junction."""
    return heading_out(toward.back, LOOK_M)


def importance(edge: RoadEdge) -> float:
    """Return how important a road is by its class."""
    if edge.tags.get("service") == "driveway" and not edge.road_class.endswith("_link"):
        return 0.2
    return road_class(edge.road_class).importance


def has_priority(tags: Mapping[str, str]) -> bool:
    """Return whether signs 306 (or what the road looks like) make it a priority road."""
    return tags.get("priority_road") in ("designated", "yes_unposted", "yes")


def standings(entries: list[Entry], arms: int, driving_side: DrivingSide) -> list[Standing]:
    """Return how each road into one junction ranks there; `arms` counts those that lead out too.

    In this order: a tagged stop or give-way sign (StVO §8 (1) 1, signs 205 and 206; UK Highway
    Code 171, 172; MUTCD 2B.05, 2B.08); a tagged priority road (signs 301, 306; §8 (1) 1); a way
    out of a yard, a track or a living street (§10); a sign on the road opposite, since a road that
    is crossed has them on both sides; a road of lower class where one is tertiary or more, since
    the higher one then is signed with priority (VwV-StVO zu §8 (1) III), but not within a 30 zone
    (§45 (1c) 4); a link road that joins a street (§18 (3)); of numbered roads who leaves the one
    whose number or name goes on; the stem of a T of classified roads, which have signs everywhere
    (VwV-StVO zu §8 (1) III, IV), or, where traffic keeps left, of any roads (UK Highway Code 170,
    172). The rest are equals, among whom the near side goes first.
    """
    found: list[Standing | None] = [_by_tags(entry) for entry in entries]
    _yards(entries, found)
    for i, entry in enumerate(entries):
        j = entry.opposite
        sign = None if j is None else entries[j].sign
        if found[i] is not None or j is None or sign is None:
            continue
        if importance(entry.edge) <= importance(entries[j].edge) and _others(found, i, j):
            found[i] = Standing(Rank.MINOR, sign, "inferred")
    _lesser(entries, found)
    if not any(found):
        _through(entries, found, arms, driving_side)
    plain = Standing(Rank.PLAIN, "near_side", "default")
    return [plain if standing is None else standing for standing in found]


def _by_tags(entry: Entry) -> Standing | None:
    if entry.sign is not None:
        return Standing(Rank.MINOR, entry.sign, "tagged")
    if has_priority(entry.edge.tags):
        return Standing(Rank.PRIORITY, "priority_road", "tagged")
    return None


def _yards(entries: list[Entry], found: list[Standing | None]) -> None:
    top = max((importance(entry.edge) for entry in entries), default=0.0)
    for i, entry in enumerate(entries):
        if found[i] is None and importance(entry.edge) <= _YARD < top:
            found[i] = Standing(Rank.YARD, "lesser_road", "inferred")


def _others(found: list[Standing | None], i: int, j: int) -> bool:
    """Return whether a road is left that the two would wait for."""
    return any(k not in (i, j) and (s is None or s.rank > Rank.MINOR) for k, s in enumerate(found))


def _lesser(entries: list[Entry], found: list[Standing | None]) -> None:
    open_ones = [i for i, standing in enumerate(found) if standing is None]
    top = max((importance(entries[i].edge) for i in open_ones), default=0.0)
    zone = all(_in_zone(entry.edge.tags) for entry in entries)
    for i in open_ones:
        mine = importance(entries[i].edge)
        link = mine < 3.0 <= top
        if mine < top and (link or (top >= _NUMBERED and not zone)):
            found[i] = Standing(Rank.MINOR, "lesser_road", "inferred")


def _through(
    entries: list[Entry], found: list[Standing | None], arms: int, driving_side: DrivingSide
) -> None:
    """Let the road that goes on through the junction go first, where one road does."""
    classes = [importance(entry.edge) for entry in entries]
    lesser: list[int] = []
    if len(entries) >= 3 and min(classes) >= _NUMBERED:
        mine = [_known_as(entry.edge) for entry in entries]
        shared = {name for name in mine if name and mine.count(name) > 1}
        if len(shared) == 1:
            lesser = [i for i, name in enumerate(mine) if name not in shared]
    signed = driving_side == "left" or min(classes, default=0.0) >= _CLASSIFIED
    if not lesser and arms == 3 and signed:
        stems = [i for i, entry in enumerate(entries) if not entry.leads_on]
        lesser = stems if len(stems) == 1 < len(entries) else []
    for i in lesser:
        found[i] = Standing(Rank.MINOR, "lesser_road", "inferred")


def _known_as(edge: RoadEdge) -> str:
    return edge.tags.get("ref") or edge.name


def _in_zone(tags: Mapping[str, str]) -> bool:
    # A bare number under `maxspeed` is a sign, under the other keys the name of a zone.
    return any(
        "zone" in (word := tags.get(key, "").lower()) and word.endswith(("20", "30"))
        for key in ("maxspeed", "maxspeed:type", "source:maxspeed")
    ) or tags.get("zone:maxspeed", "").endswith(("20", "30"))
