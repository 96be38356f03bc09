"""Connections: which lane leads to which through a junction, and the curve between them."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import PlaceSource, Quantity
from foretwin.contracts.world import Connection, DrivingSide, LineControl, Turn
from foretwin.geometry.polyline import cross, left_of, unit
from foretwin.geometry.steering import LEAST_RADIUS_M
from foretwin.world_gen.connections.forks import beside_at_fork, merged_ends, merges
from foretwin.world_gen.connections.lane_choice import lanes_chosen, named_by_tags
from foretwin.world_gen.connections.movements import Movement
from foretwin.world_gen.connections.slight_arrows import read_as_straight
from foretwin.world_gen.lanes.cluster import Cluster
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneDraft, LaneSet
from foretwin.world_gen.lanes.lane_plans import LanePlan
from foretwin.world_gen.roads.road_graph import DirectedEdge, EdgeKey

_UNDRAWN = np.zeros((0, 2))


class ConnectionDraft(msgspec.Struct):
    """A connection while the World is being built."""

    id: str
    start: LaneDraft
    end: LaneDraft
    turn: Turn
    centerline: Array
    width_m: Quantity
    cluster: Cluster
    movement: Movement
    control: LineControl = "none"
    conflicts_with: tuple[str, ...] = ()
    yields_to: tuple[str, ...] = ()
    signal_group_id: str | None = None
    path_source: PlaceSource | msgspec.UnsetType = msgspec.UNSET
    red_after_stop: bool = False

    def finished(self) -> Connection:
        """Return the connection as the World holds it."""
        junction = self.cluster.junction
        return Connection(
            id=self.id,
            from_lane_id=self.start.id,
            to_lane_id=self.end.id,
            turn=self.turn,
            centerline=self.centerline,
            width_m=self.width_m,
            control=self.control,
            conflicts_with=self.conflicts_with,
            yields_to=self.yields_to,
            junction_id=junction.summary.id if junction is not None else "",
            place_id=self.cluster.key,
            signal_group_id=self.signal_group_id,
            layer=self.start.edge.layer,
            path_source=self.path_source,
            red_after_stop=self.red_after_stop or msgspec.UNSET,
        )


def connect(
    cluster: Cluster,
    ways: tuple[Movement, ...],
    around: Surroundings,
    lanes: LaneSet,
    notes: list[str],
) -> list[ConnectionDraft]:
    """Return the connections of one cluster, yet to be drawn, and enter them as successors."""
    found: list[ConnectionDraft] = []
    side = around.driving_side
    merging = merges(cluster, ways, side)
    by_road: dict[EdgeKey, list[Movement]] = {}
    for way in ways:
        by_road.setdefault(way.toward.key, []).append(way)
    for mine in by_road.values():
        toward = mine[0].toward
        plans = _plans(cluster, toward, around)
        starts = lanes.incoming(toward, plans)
        middle = lanes.incoming(toward, around.lanes_along(toward).turning)
        read_as_straight(mine, starts)
        named = named_by_tags(mine, starts)
        beside = beside_at_fork(cluster, named, around)
        all_ends = [lanes.outgoing(m.away, _plans(cluster, m.away, around)) for m in mine]
        room = [len(ends) for ends in all_ends]
        all_chosen = lanes_chosen(named, starts, middle, room, beside, side)
        rows = zip(mine, named, all_ends, all_chosen, strict=True)
        for unnamed, movement, ends, chosen in rows:
            if not starts or not ends:
                continue
            if not chosen and len(starts) < len(plans):
                continue  # the lanes for it are beyond the World's edge
            if not chosen:
                notes.append(
                    f"way {toward.edge.way_id}: its turn lanes leave no lane for "
                    f"{movement.turn} into way {movement.away.edge.way_id}; left out"
                )
                continue
            if len(ends) > 1 and any(unnamed is m for m in merging):
                ends = merged_ends(unnamed, merging, ends, around)
            for a, b in _pairs(chosen, ends, movement.turn, side, len(mine) == 1):
                found.append(_drafted(a, b, movement, cluster))
    for connection in found:
        connection.start.successors.append(connection.id)
        if connection.start.plan.turns_source != "tagged":
            turns = dict.fromkeys((*connection.start.turns, connection.turn))
            connection.start.turns = tuple(turns)
    return found


def _plans(cluster: Cluster, edge: DirectedEdge, around: Surroundings) -> tuple[LanePlan, ...]:
    """Return the lanes that lead into a cluster, or out of it, along an edge, from the left."""
    along = around.lanes_along(edge)
    return along.abreast if cluster.plain else along.driven


def _pairs(
    starts: list[LaneDraft],
    ends: list[LaneDraft],
    turn: Turn,
    driving_side: DrivingSide,
    only_way: bool,
) -> list[tuple[LaneDraft, LaneDraft]]:
    """Pair lanes from the side to which the movement turns; surplus lanes merge into the last."""
    if len(starts) == len(ends) == 1:
        return [(starts[0], ends[0])]
    buses = [lane for lane in starts if lane.kind == "bus"]
    reserved = [lane for lane in ends if lane.kind == "bus"]
    if buses and reserved and len(buses) < len(starts):
        cars = [lane for lane in starts if lane.kind != "bus"]
        return [
            *_pairs(cars, ends, turn, driving_side, only_way),
            *_pairs(buses, reserved, turn, driving_side, only_way),
        ]
    if turn == "u_turn":
        from_inside = ends if driving_side == "right" else ends[::-1]
        return [(lane, _wide_enough(lane, from_inside)) for lane in starts]
    if any(lane.kind != "bus" for lane in starts):
        ends = [lane for lane in ends if lane.kind == "driving"] or ends
    from_right = turn == "right" or (turn == "straight" and driving_side == "left")
    a = starts[::-1] if from_right else starts
    b = ends[::-1] if from_right else ends
    if turn == "straight" and len(a) != len(b):
        return _pairs_by_position(a, b, only_way)
    return [(lane, b[min(i, len(b) - 1)]) for i, lane in enumerate(a)]


def _wide_enough(start: LaneDraft, ends: list[LaneDraft]) -> LaneDraft:
    """Return the first lane from the inside that can be reached by a half circle."""
    cars = [lane for lane in ends if lane.kind == "driving"] or ends
    at = start.centerline[-1]
    ahead = unit(at - start.centerline[-2])
    aside = [abs(cross(ahead, lane.centerline[0] - at)) for lane in cars]
    wide = [lane for lane, gap in zip(cars, aside, strict=True) if gap >= 2.0 * LEAST_RADIUS_M]
    return wide[0] if wide else cars[-1]


def _pairs_by_position(
    starts: list[LaneDraft], ends: list[LaneDraft], only_way: bool
) -> list[tuple[LaneDraft, LaneDraft]]:
    """Pair each lane with the one ahead of it; where a road widens every new lane is reached."""
    ahead = unit(ends[0].centerline[1] - ends[0].centerline[0])
    side = left_of(ahead)
    at_start = np.array([lane.centerline[-1] @ side for lane in starts])
    at_end = np.array([lane.centerline[0] @ side for lane in ends])
    gaps = np.abs(at_start[:, None] - at_end[None, :])
    best = np.maximum.accumulate(gaps.argmin(axis=1))
    pairs = {(i, int(j)) for i, j in enumerate(best)}
    if only_way or len(starts) > len(ends):
        pairs |= {(int(i), j) for j, i in enumerate(gaps.argmin(axis=0)) if j not in best}
    return [(starts[i], ends[j]) for i, j in sorted(pairs)]


def _narrower(start: Quantity, end: Quantity) -> Quantity:
    """Return the width that both lanes have; it is inferred, or a default as theirs is."""
    narrow = min(start, end, key=lambda width: width.value)
    return Quantity(narrow.value, "default" if narrow.source == "default" else "inferred")


def _drafted(
    start: LaneDraft, end: LaneDraft, movement: Movement, cluster: Cluster
) -> ConnectionDraft:
    return ConnectionDraft(
        id=f"{start.id}>{end.id}",
        start=start,
        end=end,
        turn=movement.turn,
        centerline=_UNDRAWN,
        width_m=_narrower(start.width_m, end.width_m),
        cluster=cluster,
        movement=movement,
    )
