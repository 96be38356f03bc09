"""Which lanes and connections of a junction see green together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import compress

import msgspec
import numpy as np
import shapely

from foretwin.contracts.signals import SignalGroup
from foretwin.contracts.world import Crossing
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneDraft, LaneSet
from foretwin.world_gen.rules.approaches import Approach
from foretwin.world_gen.rules.stop_lines import entering

CROSSING_WITHIN_M = 25.0


class LaneGroup(msgspec.Struct, kw_only=True):
    """Lanes of one approach with lights of their own; `turning` ones turn across alone."""

    id: str
    approach: Approach
    lanes: tuple[LaneDraft, ...]
    turning: bool
    connections: list[ConnectionDraft] = msgspec.field(default_factory=list)

    def finished(self) -> SignalGroup:
        """Return the group as the World holds it."""
        return SignalGroup(id=self.id, connection_ids=tuple(sorted(c.id for c in self.connections)))

    def order(self) -> tuple[int, int, bool, str]:
        """Return what the group is numbered by: its way, its road's end, turning lanes last."""
        toward = self.approach.toward
        return toward.edge.way_id, toward.end_node, self.turning, self.lanes[0].id


def lane_groups(
    found: Sequence[Approach],
    around: Surroundings,
    lanes: LaneSet,
    connections: Sequence[ConnectionDraft],
) -> dict[str, list[LaneGroup]]:
    """Return by junction the groups of signalled approaches; connections get the name of theirs.

    Lanes that the map tags for the turn across oncoming traffic alone have lights of their own.
    Groups of a junction are numbered in the order of their ways, so that every World that holds
    the junction, and every map of the same place, has the same ids.
    """
    across = "left" if around.driving_side == "right" else "right"
    by_junction: dict[str, list[LaneGroup]] = {}
    for approach in found:
        mine = entering(approach, around, lanes)
        if approach.control.value != "signal" or not mine:
            continue
        tagged = [lane for lane in mine if lane.plan.turns_source == "tagged"]
        own = [n for n in tagged if across in n.turns and set(n.turns) <= {across, "u_turn"}]
        rest = [lane for lane in mine if lane not in own]
        groups = by_junction.setdefault(approach.junction_id, [])
        for part in (rest, own):
            if part:
                turning = part is own and bool(rest)
                group = LaneGroup(id="", approach=approach, lanes=tuple(part), turning=turning)
                groups.append(group)
    of_lane: dict[str, LaneGroup] = {}
    for name, groups in by_junction.items():
        groups.sort(key=LaneGroup.order)
        for i, group in enumerate(groups):
            group.id = f"{name}:g{i}"
            of_lane.update((lane.id, group) for lane in group.lanes)
    for c in connections:
        known = of_lane.get(c.start.id)
        if known is not None and c.control == "signal":
            known.connections.append(c)
            c.signal_group_id = known.id
    return by_junction


class WalkGroup(msgspec.Struct, frozen=True, kw_only=True):
    """A crossing with lights for those on foot, and the groups that may not drive meanwhile."""

    id: str
    crossing: Crossing
    against: frozenset[str]

    def finished(self) -> SignalGroup:
        """Return the group as the World holds it."""
        return SignalGroup(id=self.id, connection_ids=(), crossing_ids=(self.crossing.id,))


def walk_groups(
    groups: Mapping[str, Sequence[LaneGroup]], crossings: Sequence[Crossing], around: Surroundings
) -> dict[str, list[WalkGroup]]:
    """Return the groups of signalled crossings by junction; `groups` are those of its lanes.

    Who enters by the crossed road may not drive meanwhile, nor who leaves by it straight on;
    who turns into it waits for those on foot (StVO §9 (3), RiLSA 2015 2.3.1).
    """
    lit = {c.osm_node: c for c in crossings if c.kind.value == "traffic_signals" and c.osm_node}
    found: dict[str, list[WalkGroup]] = {}
    for name, mine in groups.items():
        signalled = lit.keys() & set(_nodes_at(name, around))
        against: dict[int, set[str]] = {node: set() for node in signalled}
        for group in mine:
            for c in group.connections:
                way = [c.movement.toward, *c.movement.inside]
                if c.turn == "straight":
                    way.append(c.movement.away)
                on_way = {node for part in way for node in part.edge.node_ids}
                for node in against:
                    if node in on_way or (c.turn == "straight" and _crosses(c, lit[node])):
                        against[node].add(group.id)
        found[name] = [
            WalkGroup(
                id=f"{name}:g{len(mine) + i}", crossing=lit[node], against=frozenset(against[node])
            )
            for i, node in enumerate(sorted(against))
        ]
    return found


def _crosses(connection: ConnectionDraft, crossing: Crossing) -> bool:
    """Return whether a path leads over a crossing of another carriageway that begins beside it."""
    path = shapely.LineString(connection.centerline)
    return bool(path.intersects(shapely.LineString(crossing.line)))


def _nodes_at(junction_id: str, around: Surroundings) -> Iterator[int]:
    """Yield the nodes of the roads in a junction, and those of its legs that are near."""
    for cluster in around.clusters:
        if cluster.junction is None or cluster.junction.summary.id != junction_id:
            continue
        for leg in cluster.legs:
            away_m = np.hypot(*(leg.xy_m - leg.xy_m[0]).T)
            yield from compress(leg.node_ids, away_m <= CROSSING_WITHIN_M)
        for index in cluster.inner & around.edges.keys():
            yield from around.edges[index].node_ids
