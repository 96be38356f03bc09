"""What a junction's World says by subject, and from where: tagged, inferred or a default."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence

import msgspec
import numpy as np

from foretwin.contracts.beside_road import Building
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import (
    ROUNDABOUT_KINDS,
    Conflict,
    Connection,
    Crossing,
    Lane,
    Road,
    StopLine,
    Turn,
    World,
    WorldJunction,
    YieldRule,
)
from foretwin.world_gen.report.values import SubjectReport, Value, subject_report

CROSSING_REACH_M = 40.0
"""A crossing counts for the nearest junction within this."""
_FROM_LEFT: tuple[Turn, ...] = ("u_turn", "left", "straight", "right")
_WINDS = (
    "east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east",
)  # fmt: skip
_MPS_TO_KMPH = 3.6
_RULES: Mapping[YieldRule, str] = {
    "stop": "stop sign",
    "give_way": "give-way sign",
    "roundabout": "the ring goes first",
    "priority_road": "priority road",
    "lesser_road": "lesser road",
    "turn_across": "turns across oncoming traffic",
    "near_side": "who comes from the near side goes first",
    "far_side": "who comes from the far side goes first",
    "u_turn": "turns back",
    "merge_order": "merging lanes",
    "order": "no rule says; a fixed order",
}
_CONTROLS = {
    "signal": "stops at a signal",
    "stop": "stops at a sign",
    "give_way": "gives way at a sign",
    "none": "no sign or signal",
}
_NO_SIGN = "gives way, though the map has no sign"
"""Of lesser roads and ways into a ring."""


class Neighbourhood:
    """A World by id: what belongs to each of its junctions."""

    def __init__(self, world: World) -> None:
        self.roads = {road.id: road for road in world.roads}
        self.lanes = {lane.id: lane for lane in world.lanes}
        self.connections = {c.id: c for c in world.connections}
        self.of_junction: dict[str, list[Connection]] = defaultdict(list)
        for connection in world.connections:
            self.of_junction[connection.junction_id].append(connection)
        self.lines: dict[str, list[StopLine]] = defaultdict(list)
        for line in world.stop_lines:
            self.lines[line.lane_id].append(line)
        self.heads: dict[str, list[Signal]] = defaultdict(list)
        for head in world.signals:
            for lane in head.lane_ids:
                self.heads[lane].append(head)
        self.conflicts: dict[str, list[Conflict]] = defaultdict(list)
        for conflict in world.conflicts:
            self.conflicts[self.connections[conflict.first_id].junction_id].append(conflict)
        self.crossings = _crossings_by_junction(world)

    def road_name(self, lane_id: str) -> str:
        """Return what to call the road of a lane."""
        lane = self.lanes[lane_id]
        return _called(lane.name, lane.osm_way, self.roads.get(lane.road_id))

    def comes_from(self, lane_id: str) -> str:
        """Return the wind from which a lane comes to its end: "west" of one that goes east."""
        (x_m, y_m), (end_x_m, end_y_m) = np.asarray(self.lanes[lane_id].centerline)[-2:, :2]
        turns = math.atan2(y_m - end_y_m, x_m - end_x_m) / math.tau
        return _WINDS[round(turns * len(_WINDS)) % len(_WINDS)]


def _called(name: str, osm_way: int, road: Road | None) -> str:
    if name:
        return name
    kind = road.road_class.replace("_", " ") if road is not None else "road"
    return f"unnamed {kind} (way {osm_way})"


def _crossings_by_junction(world: World) -> dict[str, list[Crossing]]:
    found: dict[str, list[Crossing]] = defaultdict(list)
    places = [
        (j.summary.id, j.area.outline.mean(axis=0)) for j in world.junctions if j.area is not None
    ]
    if not places:
        return found
    centres = np.array([centre for _, centre in places])
    for crossing in world.crossings:
        away = np.hypot(*(centres - crossing.line.mean(axis=0)).T)
        nearest = int(away.argmin())
        if away[nearest] <= CROSSING_REACH_M:
            found[places[nearest][0]].append(crossing)
    return found


def junction_subjects(at: Neighbourhood, junction: WorldJunction) -> tuple[SubjectReport, ...]:
    """Return all subjects of one junction that have values."""
    place = junction.summary.id
    connections = at.of_junction[place]
    entering = _lanes(at, (c.from_lane_id for c in connections))
    touching = _lanes(at, (i for c in connections for i in (c.from_lane_id, c.to_lane_id)))
    roads = {lane.road_id: at.roads[lane.road_id] for lane in touching if lane.road_id in at.roads}
    heads = {head.id: head for lane in entering for head in at.heads[lane.id]}
    lines = [line for lane in entering for line in at.lines[lane.id]]
    values = {
        "kind": _kind(junction),
        "lane counts": _lane_counts(roads.values()),
        "lane widths": [_width(at, lane) for lane in touching],
        "turns": [_turns(at, lane) for lane in entering],
        "directions": [_direction(at, lane) for lane in touching],
        "speed limits": [_speed(at, lane) for lane in touching],
        "control": [_line(at, line, at.conflicts[place]) for line in lines],
        "signals": _signals(at, junction, heads.values()),
        "right of way": [_right_of_way(at, conflict) for conflict in at.conflicts[place]],
        "crossings": _crossings(at.crossings[place]),
    }
    return tuple(subject_report(subject, found) for subject, found in values.items() if found)


def building_subject(buildings: Sequence[Building]) -> SubjectReport:
    """Return where building heights came from; those guessed alike stand in one sentence."""
    alike = Counter(
        (f"{b.height_m.value:.1f} m high", b.height_m.source)
        for b in buildings
        if b.height_m.source != "tagged"
    )
    values = [Value("", "", b.height_m.source) for b in buildings]
    reason = {"inferred": "from their levels", "default": "default"}
    guessed = tuple(
        f"{n} building{'s' if n > 1 else ''}: {words}, {reason[source]}"
        for (words, source), n in sorted(alike.items(), key=lambda i: (i[0][1], -i[1], i[0][0]))
    )
    return msgspec.structs.replace(subject_report("building heights", values), guessed=guessed)


def _lanes(at: Neighbourhood, ids: Iterable[str]) -> list[Lane]:
    return [at.lanes[i] for i in dict.fromkeys(ids) if i in at.lanes]


def _kind(junction: WorldJunction) -> list[Value]:
    kind = junction.summary.kind
    ring = kind in ROUNDABOUT_KINDS
    found = [Value("junction", kind.replace("_", " "), "tagged" if ring else "inferred")]
    for arm in junction.arms:
        one = len(arm.osm_ways) == 1
        words = "one arm" if one else f"one arm made of {len(arm.osm_ways)} ways"
        name = arm.name or f"way {arm.osm_ways[0]}"
        found.append(Value(name, words, "tagged" if one else "inferred"))
    return found


def _lane_counts(roads: Iterable[Road]) -> list[Value]:
    ways = {road.osm_way: road for road in roads}
    found = []
    for road in ways.values():
        words = f"{len(road.lane_ids)} lane{'s' if len(road.lane_ids) != 1 else ''}"
        name = _called(road.name, road.osm_way, road)
        found.append(Value(name, words, road.lane_count_source))
    return found


def _width(at: Neighbourhood, lane: Lane) -> Value:
    width = lane.width_m
    return Value(at.road_name(lane.id), f"lane {width.value:.2f} m wide", width.source)


def _turns(at: Neighbourhood, lane: Lane) -> Value:
    turns = sorted(lane.turns, key=_FROM_LEFT.index)
    words = ", ".join(turn.replace("_", "-") for turn in turns) or "no turn"
    return Value(at.road_name(lane.id), f"lane for {words}", lane.turns_source)


def _direction(at: Neighbourhood, lane: Lane) -> Value:
    road = at.roads.get(lane.road_id)
    ways = {at.lanes[i].reverse for i in road.lane_ids if i in at.lanes} if road else {lane.reverse}
    words = "traffic both ways" if len(ways) == 2 else "one-way traffic"
    return Value(at.road_name(lane.id), words, lane.direction_source)


def _speed(at: Neighbourhood, lane: Lane) -> Value:
    limit = lane.speed_limit_mps
    return Value(at.road_name(lane.id), f"{limit.value * _MPS_TO_KMPH:.0f} km/h", limit.source)


def _line(at: Neighbourhood, line: StopLine, conflicts: Sequence[Conflict]) -> Value:
    words = _CONTROLS.get(line.control.value, line.control.value)
    if line.control.value == "give_way" and line.control.source != "tagged":
        rules = {one.rule for one in conflicts if _comes_by(at, one) == line.lane_id}
        words = words if rules & {"give_way", "stop"} else _NO_SIGN
    onto = at.connections.get(line.connection_id or "")
    if onto is not None:
        words = f"{words} on the way into {at.road_name(onto.to_lane_id)}"
    return Value(at.road_name(line.lane_id), words, line.control.source)


def _comes_by(at: Neighbourhood, conflict: Conflict) -> str:
    """Return the lane by which who waits comes."""
    return at.connections[conflict.yields_id].from_lane_id


def _signals(at: Neighbourhood, junction: WorldJunction, heads: Iterable[Signal]) -> list[Value]:
    found = [Value(at.road_name(head.lane_ids[0]), "signal head", head.source) for head in heads]
    plan = junction.plan
    if plan is not None:
        found.append(Value("junction", f"signal plan of {len(plan.phases)} phases", plan.source))
    return found


def _right_of_way(at: Neighbourhood, conflict: Conflict) -> Value:
    waits, goes = (
        at.connections[one].from_lane_id for one in (conflict.yields_id, conflict.goes_id)
    )
    who, whom = at.road_name(waits), at.road_name(goes)
    if who == whom:
        who, whom = (f"{who} from the {at.comes_from(one)}" for one in (waits, goes))
    if who == whom:
        whom = "the lane beside"
    return Value(who, f"waits for {whom} ({_RULES[conflict.rule]})", conflict.source)


def _crossings(crossings: Iterable[Crossing]) -> list[Value]:
    found = []
    for crossing in crossings:
        kind, width = crossing.kind, crossing.width_m
        found.append(Value("crossing", kind.value.replace("_", " "), kind.source))
        found.append(Value("crossing", f"{width.value:.1f} m wide", width.source))
    return found
