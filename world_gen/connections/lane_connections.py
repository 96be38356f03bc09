"""Connections: which lane leads to which through a junction, and the curve between them."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import Connection, DrivingSide, LineControl, Turn
from foretwin.geometry.polyline import cross, left_of, unit
from foretwin.geometry.steering import LEAST_RADIUS_M
from foretwin.world_gen.connections.forks import beside_at_fork, merged_ends, merges
from foretwin.world_gen.connections.movements import Movement
from foretwin.world_gen.lanes.clusters import Surroundings
from foretwin.world_gen.lanes.lane_curves import LaneDraft, LaneSet
from foretwin.world_gen.lanes.lane_plans import LanePlan
from foretwin.world_gen.lanes.legs import Cluster
from foretwin.world_gen.roads.road_graph import DirectedEdge

_UNDRAWN = np.zeros((0, 2))
_FROM_LEFT: tuple[Turn, ...] = ("left", "straight", "right")


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
    merging = merges(cluster, ways)
    by_road: dict[tuple[int, bool], list[Movement]] = {}
    for way in ways:
        by_road.setdefault((way.toward.edge.index, way.toward.reverse), []).append(way)
    for mine in by_road.values():
        toward = mine[0].toward
        plans = _plans(cluster, toward, around)
        starts = lanes.incoming(toward, plans)
        middle = lanes.incoming(toward, around.lanes_along(toward).turning)
        named = _by_tags(mine, starts)
        beside = beside_at_fork(cluster, named, around)
        for unnamed, movement in zip(mine, named, strict=True):
            away = movement.away
            ends = lanes.outgoing(away, _plans(cluster, away, around))
            if not starts or not ends:
                continue
            # Where a road merely goes on its lanes do, whatever their arrows mean for what follows.
            chosen = starts if cluster.plain else []
            chosen = chosen or [lane for lane in middle if movement.turn in lane.turns]
            chosen = chosen or _starting_lanes(
                movement, starts, mine, len(ends), beside, around.driving_side
            )
            if not chosen and len(starts) < len(plans):
                continue  # the lanes for it are beyond the World's edge
            if not chosen:
                notes.append(
                    f"way {toward.edge.way_id}: its turn lanes leave no lane for "
                    f"{movement.turn} into way {away.edge.way_id}; left out"
                )
                continue
            if merging and len(ends) > 1:
                ends = merged_ends(unnamed, merging, ends, around)
            for a, b in _pairs(chosen, ends, movement.turn, around.driving_side, len(mine) == 1):
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


def _by_tags(ways: list[Movement], starts: list[LaneDraft]) -> list[Movement]:
    """Let turn lanes correct the names of turns, which angles alone do not determine at forks.

    As many movements as there are tagged turns take them in order from the left; else a turn
    that no lane names takes the name of a tagged one that no other movement took up.
    """
    if any(lane.plan.turns_source != "tagged" for lane in starts):
        return ways
    tagged = {turn for lane in starts for turn in lane.plan.turns} - {"u_turn"}
    forward = sorted((m for m in ways if m.turn != "u_turn"), key=lambda m: -m.angle_rad)
    have = {m.turn for m in forward}
    if not tagged or have <= tagged:
        return ways
    if len(forward) == len(tagged):
        named = zip(forward, sorted(tagged, key=_FROM_LEFT.index), strict=True)
        turn_of = {id(m): turn for m, turn in named}
    else:
        turn_of = {id(m): _free_name(m, tagged, have) for m in forward if m.turn not in tagged}
    return [msgspec.structs.replace(m, turn=turn_of.get(id(m), m.turn)) for m in ways]


def _free_name(movement: Movement, tagged: set[Turn], have: set[Turn]) -> Turn:
    side: Turn = "left" if movement.angle_rad > 0 else "right"
    names: tuple[Turn, ...] = (side, "straight")
    return next((name for name in names if name in tagged and name not in have), movement.turn)


def _starting_lanes(
    movement: Movement,
    starts: list[LaneDraft],
    ways: list[Movement],
    room: int,
    beside: int,
    driving_side: DrivingSide,
) -> list[LaneDraft]:
    """Return the lanes, from the left, from which this movement begins.

    `room` is the number of lanes it leads to. Where a one-way road forks, `beside` is that of
    the branch straight on, else 0: there one lane at most leads into both branches.
    """
    if len(starts) == 1 and starts[0].plan.turns_source != "tagged":
        return starts
    turn = movement.turn
    far: Turn = "left" if driving_side == "right" else "right"
    cars = [lane for lane in starts if lane.kind == "driving"] or starts
    fits, named = cars, 1
    tagged = any(lane.plan.turns_source == "tagged" for lane in starts)
    if tagged:
        meant = {turn, far} if turn == "u_turn" else {turn}
        silent = [lane.plan.turns_source != "tagged" for lane in starts]
        fits = [n for n, ok in zip(starts, silent, strict=True) if ok or meant & set(n.plan.turns)]
        named = sum(lane.plan.turns_source == "tagged" for lane in fits)
    if turn == "u_turn":
        return _outermost(fits, far)
    if turn != "straight":
        # Lanes without an arrow go straight on; beside a tagged lane those turn that have room.
        with_room = min(room, len(cars) + 1 - beside) if beside else 1
        return _outermost(fits, turn, max(named, with_room))
    if tagged:
        return fits
    have = {m.turn for m in ways}
    straight = list(starts)
    # The lane on the far side, from which drivers turn across the road, is the first to be lost.
    sides: list[Turn] = ["left", "right"] if driving_side == "right" else ["right", "left"]
    for side in sides:
        if len(straight) > max(room, 1) and side in have:
            straight = straight[1:] if side == "left" else straight[:-1]
    return straight


def _outermost(lanes: list[LaneDraft], side: Turn, count: int = 1) -> list[LaneDraft]:
    return lanes[:count] if side == "left" else lanes[-count:]


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


def _drafted(
    start: LaneDraft, end: LaneDraft, movement: Movement, cluster: Cluster
) -> ConnectionDraft:
    return ConnectionDraft(
        id=f"{start.id}>{end.id}",
        start=start,
        end=end,
        turn=movement.turn,
        centerline=_UNDRAWN,
        width_m=Quantity(min(start.width_m.value, end.width_m.value), "inferred"),
        cluster=cluster,
        movement=movement,
    )
