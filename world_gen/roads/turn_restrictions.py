"""Turn restrictions of the map: which way after which way may not, or must, be taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby, product
from typing import NamedTuple

import msgspec

from foretwin.world_gen.osm.osm_map import OsmMap, OsmRelation
from foretwin.world_gen.roads.road_graph import DirectedEdge, RoadEdge, RoadGraph

_KEYS = ("restriction:motorcar", "restriction:motor_vehicle", "restriction:vehicle", "restriction")
"""The most specific word holds; one for lorries or buses alone does not, nor one at times."""
_TIMED = frozenset({"day_on", "day_off", "hour_on", "hour_off", "time", "opening_hours"})
"""How mappers said when a restriction holds, before `restriction:conditional`."""
_CARS = frozenset({"motorcar", "motor_vehicle", "vehicle"})


class TurnRule(NamedTuple):
    """A restriction at one node, or over one or more ways between.

    `only` means: from there nowhere but to `to_ways`.
    """

    relation: int
    from_way: int
    via_ways: tuple[int, ...]
    to_ways: frozenset[int]
    only: bool
    u_turn: bool


class TurnRestrictions(msgspec.Struct, frozen=True):
    """All restrictions for cars, by via node, and those with via ways."""

    at_node: Mapping[int, tuple[TurnRule, ...]]
    over_ways: tuple[TurnRule, ...]
    on_red: frozenset[tuple[int, int]] = frozenset()
    """Ways from and to which signs forbid the turn on red alone."""
    impossible: tuple[TurnRule, ...] = ()
    """What allows nothing but a way that cannot be driven from there: it does not hold."""

    def step_allowed(self, before: DirectedEdge, after: DirectedEdge) -> bool:
        """Return whether a car may go from one edge onto the next at their common node."""
        rules = self.at_node.get(before.end_node)
        if rules is None:
            return True
        turns_back = before.edge.index == after.edge.index and before.reverse != after.reverse
        only: list[bool] = []
        for rule in rules:
            if rule.from_way != before.ways[-1]:
                continue
            meant = after.ways[0] in rule.to_ways
            if meant and rule.from_way == after.ways[0]:
                # A way that goes on beyond the node: only the word parts straight on from back.
                meant = meant and turns_back == rule.u_turn
            if rule.only:
                only.append(meant)
            elif meant:
                return False
        # Two words that each allow one way alone do not close both.
        return not only or any(only)

    def path_allowed(self, path: Sequence[DirectedEdge]) -> bool:
        """Return whether no restriction over via ways forbids this sequence of edges."""
        if len(path) < 3:
            return True
        ways = [way for way, _ in groupby(way for part in path for way in part.ways)]
        for rule in self.over_ways:
            start = (rule.from_way, *rule.via_ways)
            n = len(start)
            for i in range(len(ways) - n):
                if tuple(ways[i : i + n]) == start and (ways[i + n] in rule.to_ways) != rule.only:
                    return False
        return True


UNRESTRICTED = TurnRestrictions({}, ())
"""Those of a map without any."""


def read_turn_restrictions(osm: OsmMap, graph: RoadGraph) -> TurnRestrictions:
    """Return the map's restrictions that hold for cars at all times."""
    impossible: list[TurnRule] = []
    at_node: dict[int, list[TurnRule]] = {}
    over_ways: list[TurnRule] = []
    on_red: set[tuple[int, int]] = set()
    for relation in sorted(osm.relations.values(), key=lambda r: r.id):
        tags = relation.tags
        if tags.get("type") != "restriction" or not _TIMED.isdisjoint(tags):
            continue
        word = next((tags[key] for key in _KEYS if key in tags), "")
        exempt = {part.strip() for part in tags.get("except", "").split(";")}
        if not word.startswith(("no_", "only_")) or exempt & _CARS:
            continue
        only = word.startswith("only_")
        via_ways = tuple(_members(relation, "via", "w"))
        via_nodes = _members(relation, "via", "n")
        ends = frozenset(_members(relation, "to", "w"))
        if not ends:
            continue
        if word.endswith("_on_red"):
            on_red.update(product(_members(relation, "from", "w"), ends))
            continue
        for start in _members(relation, "from", "w"):
            rule = TurnRule(relation.id, start, via_ways, ends, only, word.endswith("u_turn"))
            if via_ways:
                over_ways.append(rule)
            for node in via_nodes:
                leaving = graph.leaving.get(node, ())
                if only and ends.isdisjoint(edge.ways[0] for edge in leaving if edge.allowed):
                    impossible.append(rule)
                else:
                    at_node.setdefault(node, []).append(rule)
    return TurnRestrictions(
        {k: tuple(v) for k, v in at_node.items()},
        tuple(over_ways),
        frozenset(on_red),
        tuple(impossible),
    )


def _members(relation: OsmRelation, role: str, kind: str) -> list[int]:
    return [m.ref for m in relation.members if m.role == role and m.kind == kind]


def restriction_notes(
    restrictions: TurnRestrictions, inner: Sequence[frozenset[int]], edges: Mapping[int, RoadEdge]
) -> tuple[str, ...]:
    """Return a line for each restriction that cannot hold, and over ways beyond one place.

    `inner` are the edges within each place.
    """
    if not (restrictions.over_ways or restrictions.impossible):
        return ()
    of_way: dict[int, set[int]] = {}
    for index, edge in edges.items():
        for way in edge.ways:
            of_way.setdefault(way, set()).add(index)
    notes = [
        f"relation {rule.relation}: from way {rule.from_way} it allows only way "
        f"{', '.join(map(str, sorted(rule.to_ways)))}, which cannot be driven from there; left out"
        for rule in restrictions.impossible
        if rule.from_way in of_way
    ]
    for rule in restrictions.over_ways:
        if not {rule.from_way, *rule.via_ways} <= of_way.keys():
            continue
        inside = set().union(*(of_way[way] for way in rule.via_ways))
        if not any(inside <= edges_inside for edges_inside in inner):
            ways = ", ".join(str(way) for way in rule.via_ways)
            notes.append(
                f"relation {rule.relation}: its turn restriction from way {rule.from_way} leads "
                f"over way {ways}, part of which lies outside a junction; held there alone "
                "where the ways follow each other within one"
            )
    return tuple(dict.fromkeys(notes))
