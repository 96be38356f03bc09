"""What the car's own passes say of a World's roads and of the ways through its junctions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.geometry.polyline import left_of, locate, turn_rad
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.driven.driven_paths import driven_path
from foretwin.world_gen.driven.matching import UNKNOWN, LaneLine, Lines, PassMatch
from foretwin.world_gen.driven.passes import STEP_M, Pass
from foretwin.world_gen.driven.road_shifts import Seen, moved_roads
from foretwin.world_gen.lanes.lane_curves import LaneDraft, LaneSet
from foretwin.world_gen.roads.road_graph import EdgeKey, RoadEdge

_TURN_RAD = math.radians(20.0)
_BESIDE_TURN_M = 6.0
"""So near a turn drivers leave the middle of their lane for it."""
_LEAD = round(8.0 / STEP_M)
_SWUNG_OUT_M = 0.3
"""So far beside where they drove in their lane, drivers are turning."""
_MOST_SWUNG_M = 12.0
_FINE_M = 0.8
"""A rougher pass tells no turn from the next wider one."""
_LOOK = round(20.0 / STEP_M)


class Driven(msgspec.Struct, frozen=True):
    """Roads that lie elsewhere, by edge index, and pieces (N, 2) of passes, by connection."""

    roads: Mapping[int, RoadEdge]
    passes: Mapping[str, Sequence[Array]]
    trims_m: Mapping[EdgeKey, float]
    """How much of roads drivers need for their turns, by (edge index, at its end node)."""
    widths: Mapping[int, float]
    """How many times as wide lanes are, by edge index."""

    def hold(self, lanes: LaneSet, connections: Iterable[ConnectionDraft]) -> list[str]:
        """Lay connections along their passes where a car can keep to these, and say what moved.

        Returns what a World's notes say of it.
        """
        followed = 0
        for lane in lanes.lanes.values():
            if lane.key.edge in self.roads:
                lane.position_source = "driven"
        for c in connections:
            path = driven_path(c.centerline, self.passes[c.id]) if c.id in self.passes else None
            if path is not None:
                c.centerline, c.path_source = path, "driven"
                followed += 1
        notes = []
        if self.roads or followed:
            roads = f"{len(self.roads)} roads and {followed} ways through junctions"
            notes.append(f"{roads} lie where the car's own passes were")
        wide = {x.key.edge for x in lanes.lanes.values() if x.width_m.source == "driven"}
        if wide:
            notes.append(f"lanes of {len(wide)} roads are as wide as passes were apart")
        return notes


def driven(
    edges: Mapping[int, RoadEdge],
    lanes: LaneSet,
    connections: Sequence[ConnectionDraft],
    passes: Iterable[Pass],
    trims_m: Mapping[EdgeKey, float],
) -> Driven:
    """Match passes to the lanes that the map alone gives, and return where these were driven.

    `trims_m` are the metres cut off the lanes of edges, by (edge index, at its end node).
    """
    links = {c.id: c for c in connections}
    lines = Lines(_lines(lanes.lanes, links))
    seen: list[Seen] = []
    through: dict[str, list[Array]] = {}
    asked: dict[EdgeKey, float] = {}
    for one in passes:
        match = lines.match(one)
        ids = ["" if i == UNKNOWN else lines.ids[i] for i in match.line.tolist()]
        turning = _near_turns([key in links and _turns(links[key]) for key in ids])
        told = np.flatnonzero(match.clear & ~turning).tolist()
        on_lanes = [i for i in told if ids[i] in lanes.lanes]
        seen += [_seen(lanes.lanes[ids[i]], one, match, i) for i in on_lanes]
        if one.std_m > _FINE_M:
            continue
        for key, begin, end in _through(ids, match, links):
            through.setdefault(key, []).append(one.xy_m[max(begin - _LEAD, 0) : end + _LEAD])
            if _turns(links[key]):
                for lane, before_m in _swung_out(links[key], ids, match, begin, end):
                    place = (lane.key.edge, lane.plan.reverse == before_m.at_begin)
                    asked[place] = max(asked.get(place, 0.0), trims_m[place] + before_m.along_m)
    shifted = moved_roads(edges, seen)
    return Driven(shifted.roads, through, asked, shifted.widths)


def _lines(
    lanes: Mapping[str, LaneDraft], links: Mapping[str, ConnectionDraft]
) -> dict[str, LaneLine]:
    found = {
        lane.id: LaneLine(
            lane.centerline,
            tuple(lane.successors),
            tuple(side for side in (lane.left_id, lane.right_id) if side),
            drawn=False,
        )
        for lane in lanes.values()
        if lane.kind in ("driving", "bus")
    }
    return found | {
        c.id: LaneLine(c.centerline, (c.end.id,), (), drawn=True) for c in links.values()
    }


def _turns(connection: ConnectionDraft) -> bool:
    line = connection.centerline
    return abs(float(turn_rad(line[1] - line[0], line[-1] - line[-2]))) > _TURN_RAD


def _near_turns(turning: Sequence[bool]) -> np.ndarray:
    reach = round(_BESIDE_TURN_M / STEP_M)
    wide = np.convolve(np.array(turning, dtype=float), np.ones(2 * reach + 1), mode="same")
    return wide[: len(turning)] > 0.5


def _seen(lane: LaneDraft, one: Pass, match: PassMatch, i: int) -> Seen:
    across = left_of(one.along[i])
    place = one.xy_m[i] - (match.left_m[i] + _left_of_road_m(lane)) * across
    return Seen(
        edge=lane.key.edge,
        at_m=locate(lane.edge.xy_m, place),
        across=across,
        away_m=float(match.left_m[i]),
        lane=lane.plan.label,
        lane_m=_left_of_road_m(lane),
        std_m=one.std_m,
    )


def _left_of_road_m(lane: LaneDraft) -> float:
    """Return how far a lane lies to its own driver's left of its road's line."""
    return -lane.plan.left_m if lane.plan.reverse else lane.plan.left_m


def _through(
    ids: list[str], match: PassMatch, links: Mapping[str, ConnectionDraft]
) -> Iterable[tuple[str, int, int]]:
    """Yield the connections that a pass surely went along: first point there, and first behind."""
    begin = 0
    for i in range(1, len(ids) + 1):
        if i < len(ids) and ids[i] == ids[begin]:
            continue
        if ids[begin] in links and match.clear[begin:i].mean() > 0.5:
            yield ids[begin], begin, i
        begin = i


class _Swung(NamedTuple):
    """How far from a lane's end, or begin, a driver no longer kept to it for a turn."""

    along_m: float
    at_begin: bool


def _swung_out(
    link: ConnectionDraft, ids: list[str], match: PassMatch, begin: int, end: int
) -> Iterable[tuple[LaneDraft, _Swung]]:
    """Yield a turn's lanes where their driver left the first before its end, or kept off the other.

    What the driver kept to is how far beside the lane the pass lies farther away from the turn.
    """
    before = list(range(begin - 1, max(begin - _LOOK, 0) - 1, -1))
    behind = list(range(end, min(end + _LOOK, len(ids))))
    for lane, near, at_begin in ((link.start, before, False), (link.end, behind, True)):
        on_lane = [i for i in near if ids[i] == lane.id]
        if len(on_lane) < _LOOK // 2:
            continue
        left_m = match.left_m[on_lane]
        kept_m = float(np.median(left_m[_LOOK // 3 :]))
        beside = np.abs(left_m - kept_m) > _SWUNG_OUT_M
        steps = int(np.argmin(beside)) if not beside.all() else 0
        if steps:
            yield lane, _Swung(min(steps * STEP_M, _MOST_SWUNG_M), at_begin)
