"""Who waits where the paths of two connections meet: exactly one of them, by the rules of the road.

Rules stand in the order in which they apply:

1. A U-turn on the spot waits for everyone (StVO §9 (5); UVC 11-602); one by way of a road through
   the median is two left turns.
2. Who enters a roundabout waits for those on it (StVO §8 (1a); Highway Code 185; UVC 11-402); at a
   mini-roundabout for those who pass the driver's own entry. A ring tagged `junction=circular`
   has no such right unless signs at its entries give it (Code de la route R415-10): then rule 5.
3. Lanes of one road: who turns across a lane beside waits (§7 (5), §9 (1)); where lanes merge, who
   comes from the lane that ends (§7 (4)).
4. Under lights of both, who turns across oncoming traffic waits (§37 (2) 1, §9 (3), (4); Highway
   Code 180; UVC 11-402): signs count only where the lights are out.
5. The standing of the roads: stop and give-way signs, priority roads, ways out of yards, roads of
   lower class (see `priority_roads.standings`), and signs on slip roads past which a path leads:
   who comes past the sign of a slip road waits for all but those whom another sign inside stops.
6. Of equals whose roads lie opposite, who turns across the other waits (§9 (3), (4)). Two who
   both turn so pass in front of each other; where they have no room for that, the later id.
7. Of equals the one whose near side the other comes from: right before left where traffic
   keeps right (§8 (1); Code de la route R415-5; UVC 11-401, also at all-way stops), mirrored
   where it keeps left. British law knows no such rule (Highway Code 146): it is a default there.
   Some that keep left let the right go first (`countries.rules.first_from`).
8. Roads that run together: who goes straighter (§18 (3)), then who has the shorter way; of two
   lanes of one road that are alike in that, the one at the kerb waits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import wrap_angle
from foretwin.contracts.provenance import Provenance
from foretwin.contracts.world import Conflict, DrivingSide, YieldRule
from foretwin.geometry.polyline import arc_lengths, locate
from foretwin.geometry.polyline_batch import Polylines
from foretwin.world_gen.connections.conflicts import Meetings, meetings
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.roads.road_graph import EdgeKey
from foretwin.world_gen.rules.approaches import Approach
from foretwin.world_gen.rules.priority_roads import Rank, Standing, has_priority, importance
from foretwin.world_gen.rules.signs_inside import SignsInside

ALONGSIDE_RAD, FAST_ALONGSIDE_RAD = math.radians(10.0), math.radians(50.0)
"""Roads that meet at less run together; on motorways and trunk roads they merge at more."""
_FAST = ("motorway", "motorway_link", "trunk", "trunk_link")


class Yielding(NamedTuple):
    """Whether the first of a pair waits, by which rule, and where that is from."""

    first_waits: bool
    rule: YieldRule
    source: Provenance


class ConnectionFacts(msgspec.Struct, kw_only=True):
    """What the rules need of one connection."""

    draft: ConnectionDraft
    turn_weight: int
    """0 straight, 1 a turn to the near side, 2 across oncoming traffic, 3 a U-turn."""
    on_the_spot: bool
    """A U-turn without a road through a median."""
    heading: float
    bend_rad: float
    """How far it turns in all."""
    length_m: float
    road: EdgeKey
    opposite: EdgeKey | None
    """The road into the junction that lies straight ahead."""
    on_ring: bool
    standing: Standing
    sign: Standing | None
    """A sign inside the junction, on a slip road or in a median, from `sign_m` on."""
    sign_m: float
    sign_node: int | None
    """Two who pass the same sign do not wait for each other by it."""
    slip: bool
    """Turns to the near side; a sign inside is not that of its whole road, but a slip road's."""
    on_main: bool
    """Has run along the main road between the two mouths of a staggered junction."""
    mini: bool
    fast: bool
    exit_heading: float


def right_of_way(
    connections: Sequence[ConnectionDraft],
    found: Sequence[Approach],
    signs: SignsInside,
    driving_side: DrivingSide,
    first_from: DrivingSide | None = None,
) -> tuple[tuple[Conflict, ...], Meetings]:
    """Return every conflict with its answer, and enter them into the connections.

    Each of `connections` belongs to a junction that lies whole in the World. Of equals who comes
    from the side `first_from` goes first, without it from the near side.
    """
    met = meetings(connections)
    side = first_from or driving_side
    ways = _ways(connections, found, signs, driving_side)
    headings = np.array([way.heading for way in ways])
    turned = headings[met.second] - headings[met.first]
    angle = np.arctan2(np.sin(turned), np.cos(turned)) if len(met.first) else turned
    conflicts = []
    conflicting: list[list[str]] = [[] for _ in ways]
    waiting: list[list[str]] = [[] for _ in ways]
    values = (met.first, met.second, met.merging, met.apart_m, angle)
    rows = zip(*(column.tolist() for column in values), met.points, met.areas, strict=True)
    for i, j, merging, apart_m, from_first, point, area in rows:
        a, b = ways[i], ways[j]
        standing = a.standing, b.standing
        if a.sign_node != b.sign_node:
            own, other = (_standing_at(way, area, point, merging) for way in (a, b))
            standing = own, other
        answer = _answer(a, b, standing, from_first, apart_m < 0.01, driving_side, side)
        loser, winner = (i, j) if answer.first_waits else (j, i)
        conflicting[i].append(b.draft.id)
        conflicting[j].append(a.draft.id)
        waiting[loser].append(connections[winner].id)
        conflicts.append(
            Conflict(
                first_id=a.draft.id,
                second_id=b.draft.id,
                kind="merging" if merging else "crossing",
                point=point,
                area=area,
                yields_id=connections[loser].id,
                rule=answer.rule,
                source=answer.source,
            )
        )
    for connection, others, first in zip(connections, conflicting, waiting, strict=True):
        connection.conflicts_with = tuple(sorted(others))
        connection.yields_to = tuple(sorted(first))
    return tuple(conflicts), met


def _ways(
    connections: Sequence[ConnectionDraft],
    found: Sequence[Approach],
    signs: SignsInside,
    driving_side: DrivingSide,
) -> list[ConnectionFacts]:
    by_road = {item.key: item for item in found}
    near = "right" if driving_side == "right" else "left"
    weight: Mapping[str, int] = {"straight": 0, near: 1, "u_turn": 3}
    plain = Standing(Rank.PLAIN, "near_side", "default")
    tops: dict[str, Rank] = {}
    classes: dict[str, float] = {}
    for approach in found:
        name = approach.junction_id
        tops[name] = max(tops.get(name, Rank.YARD), approach.standing.rank)
        classes[name] = max(classes.get(name, 0.0), importance(approach.toward.edge))
    paths = Polylines.of([c.centerline for c in connections])
    gap = paths.steps[0]
    ahead = np.arctan2(gap[:, 1], gap[:, 0])
    start, end = ahead[paths.first[:-1]], ahead[paths.first[1:] - 2]
    bend = np.abs(wrap_angle(end - start))
    columns = (column.tolist() for column in (start, end, bend, paths.length_m))
    rows = zip(connections, *columns, strict=True)
    ways = []
    for c, heading, exit_heading, bend_rad, length_m in rows:
        toward = c.movement.toward
        mine = by_road.get(toward.key)
        summary = None if c.cluster.junction is None else c.cluster.junction.summary
        name, kind = ("", "other") if summary is None else (summary.id, summary.kind)
        sign = next(iter(signs.get(c.id, ())), None)
        ways.append(
            ConnectionFacts(
                draft=c,
                turn_weight=weight.get(c.turn, 2),
                on_the_spot=c.turn == "u_turn" and not c.movement.inside,
                heading=heading,
                bend_rad=bend_rad,
                length_m=length_m,
                road=toward.key,
                opposite=None if mine is None else mine.opposite,
                on_ring=c.start.role == "ring",
                standing=plain if mine is None or mine.signed_inside else mine.standing,
                sign=None if sign is None else Standing(Rank.MINOR, sign.rule, "tagged"),
                sign_m=math.inf if sign is None else sign.at_m,
                sign_node=None if sign is None else sign.node,
                slip=c.turn == near and not (mine is not None and mine.signed_inside),
                on_main=kind == "staggered" and _runs_along_main(c, tops, classes, name),
                fast=toward.edge.road_class in _FAST,
                mini=kind == "mini_roundabout",
                exit_heading=exit_heading,
            )
        )
    return ways


def _runs_along_main(
    c: ConnectionDraft, tops: Mapping[str, Rank], classes: Mapping[str, float], name: str
) -> bool:
    return any(
        importance(part.edge) >= classes.get(name, 0.0)
        and (tops.get(name) != Rank.PRIORITY or has_priority(part.edge.tags))
        for part in c.movement.inside
    )


def _answer(
    a: ConnectionFacts,
    b: ConnectionFacts,
    standing: tuple[Standing, Standing],
    angle: float,
    crossing: bool,
    driving_side: DrivingSide,
    first_from: DrivingSide,
) -> Yielding:
    """Return who of two waits; `angle` turns a's first heading into b's, positive to the left.

    `crossing` is whether the middles of their paths cross.
    """
    if a.on_the_spot != b.on_the_spot:
        return Yielding(a.on_the_spot, "u_turn", "inferred")
    if a.on_ring != b.on_ring:
        entry = b if a.on_ring else a
        if entry.standing.rule == "roundabout":
            return Yielding(b.on_ring, "roundabout", entry.standing.source)
    elif a.mini and b.mini and a.road != b.road:
        past_a = _passes(b, a, driving_side)
        if past_a != _passes(a, b, driving_side):
            return Yielding(past_a, "roundabout", "tagged")
    if a.road == b.road or (a.on_ring and b.on_ring):
        return _beside(a, b, driving_side)
    oncoming = a.opposite == b.road and b.opposite == a.road
    if oncoming and a.turn_weight == b.turn_weight == 0 and crossing:
        oncoming = False  # two bent roads that cross at a sharp angle
    if oncoming and a.draft.control == b.draft.control == "signal":
        return _across(a, b)
    first, second = standing
    sides = zip((a, b), standing, strict=True)
    a_slips, b_slips = (way.slip and way.sign is at for way, at in sides)
    if a_slips and second is not b.sign:
        return Yielding(True, first.rule, first.source)
    if b_slips and first is not a.sign:
        return Yielding(False, second.rule, second.source)
    if first.rank != second.rank:
        loser, winner = sorted((first, second))
        decisive = loser if loser.rank < Rank.PLAIN else winner
        return Yielding(loser is first, decisive.rule, decisive.source)
    if a.on_main != b.on_main and first.rank < Rank.PLAIN:
        return Yielding(b.on_main, first.rule if b.on_main else second.rule, "inferred")
    if oncoming:
        return _across(a, b)
    if abs(angle) > (FAST_ALONGSIDE_RAD if a.fast and b.fast else ALONGSIDE_RAD):
        # Who is seen to the right comes with a heading turned to the left.
        rule: YieldRule = "near_side" if first_from == driving_side else "far_side"
        return Yielding((angle > 0.0) == (first_from == "right"), rule, "default")
    return _beside(a, b, driving_side)


def _standing_at(way: ConnectionFacts, area: Array, point: Array, merging: bool) -> Standing:
    """Return the standing with which a path comes to the ground that it shares with another."""
    if way.sign is None or way.standing.rank < way.sign.rank:
        return way.standing
    xy = way.draft.centerline
    gaps = np.hypot(*(area[:, None] - xy[None]).transpose(2, 0, 1))
    reached_m = float(arc_lengths(xy)[gaps.argmin(axis=1)].min())
    # Where paths merge their middles may meet well behind the first ground that they share.
    reached_m = max(reached_m, locate(xy, point)) if merging else reached_m
    return way.sign if reached_m > way.sign_m else way.standing


def _passes(mover: ConnectionFacts, waiting: ConnectionFacts, driving_side: DrivingSide) -> bool:
    """Return whether a driver on a mini-roundabout passes another one's entry."""
    turn = 1.0 if driving_side == "right" else -1.0
    entry = mover.heading + math.pi
    to_exit = (turn * (mover.exit_heading - entry)) % math.tau or math.tau
    to_waiting = (turn * (waiting.heading + math.pi - entry)) % math.tau
    return 1e-3 < to_waiting < to_exit - 1e-3


def _across(a: ConnectionFacts, b: ConnectionFacts) -> Yielding:
    if a.turn_weight != b.turn_weight:
        return Yielding(a.turn_weight > b.turn_weight, "turn_across", "inferred")
    return Yielding(a.draft.id > b.draft.id, "turn_across" if a.turn_weight else "order", "default")


def _beside(a: ConnectionFacts, b: ConnectionFacts, driving_side: DrivingSide) -> Yielding:
    if a.turn_weight != b.turn_weight:
        return Yielding(a.turn_weight > b.turn_weight, "merge_order", "inferred")
    if abs(a.bend_rad - b.bend_rad) > math.radians(1.0):
        return Yielding(a.bend_rad > b.bend_rad, "merge_order", "inferred")
    if abs(a.length_m - b.length_m) > 0.05:
        return Yielding(a.length_m > b.length_m, "merge_order", "default")
    if a.road == b.road and a.draft.start is not b.draft.start:
        gap_m = a.draft.start.plan.left_m - b.draft.start.plan.left_m
        to_right = (gap_m < 0.0) != a.road[1]
        return Yielding(to_right == (driving_side == "right"), "merge_order", "default")
    return Yielding(a.draft.id > b.draft.id, "merge_order", "default")
