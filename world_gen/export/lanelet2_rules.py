"""Regulatory elements of a Lanelet2 map: lights, right of way, all-way stops, speed limits."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.signals import Signal, SignalPlan
from foretwin.contracts.world import Conflict, Connection, Lane, StopLine, World
from foretwin.geometry.polyline import left_of
from foretwin.world_gen.export.lanelet2_primitives import Lanelet2Map, RelationMember, Tags

LIGHT_WIDTH_M = 0.35
LIGHT_HEIGHT_M = 0.9
_BULBS = (("red", 0.75), ("yellow", 0.45), ("green", 0.15))
"""Colours and heights over the light's lower edge."""


class LaneletRules:
    """Which regulatory elements each lane or connection names, by its id in the World."""

    def __init__(self) -> None:
        self._of: dict[str, list[int]] = {}

    def of(self, name: str) -> Sequence[int]:
        """Return the ids of a lanelet's regulatory elements."""
        return self._of.get(name, ())

    def add(self, rule: int, names: Iterable[str]) -> None:
        """Let lanelets name a rule."""
        for name in dict.fromkeys(names):
            self._of.setdefault(name, []).append(rule)


def add_rules(
    world: World, ids: Mapping[str, int], crosswalks: Mapping[str, int], drawn: Lanelet2Map
) -> LaneletRules:
    """Add every regulatory element; `ids` are lanelets by the World's ids, as are `crosswalks`."""
    rules = LaneletRules()
    lines = _StopLines(world, drawn)
    _add_speed_limits(world, rules, drawn)
    _add_lights(world, ids, lines, rules, drawn)
    all_way = {j.summary.id for j in world.junctions if j.summary.control == "all_way_stop"}
    _add_all_way_stops(world, all_way, ids, lines, rules, drawn)
    _add_right_of_way(world, all_way, ids, lines, rules, drawn)
    _add_crosswalk_rules(world, crosswalks, ids, lines, rules, drawn)
    return rules


class _StopLines:
    """Stop lines as ways, drawn when a rule first needs them."""

    def __init__(self, world: World, drawn: Lanelet2Map) -> None:
        self._drawn = drawn
        self.of_lane = {
            line.lane_id: line
            for line in world.stop_lines
            if line.control.value != "none" and line.connection_id is None
        }
        self._at_sign = {
            line.connection_id: line for line in world.stop_lines if line.connection_id
        }
        self._ways: dict[tuple[str, ...], int] = {}
        for lane_id, line in self.of_lane.items():
            if line.control.value != "signal":
                self.way((lane_id,))

    def where_it_waits(self, connection: Connection, conflict: Conflict) -> int | None:
        """Return the last line before the ground that a connection shares with another."""
        line = self._at_sign.get(connection.id)
        if line is not None:
            path = shapely.LineString(connection.centerline)
            shared = path.project(shapely.points(conflict.area))
            if np.min(shared) > path.project(shapely.Point(line.ends.mean(axis=0))):
                return self._drawn_once([line])
        return self.way((connection.from_lane_id,))

    def way(self, lane_ids: Iterable[str]) -> int | None:
        """Return one line across all these lanes that have a stop line, from left to right."""
        mine = [self.of_lane[name] for name in lane_ids if name in self.of_lane]
        if not mine:
            return None
        across = mine[0].ends[1] - mine[0].ends[0]
        mine.sort(key=lambda line: float(line.ends[0] @ across))
        return self._drawn_once(mine)

    def _drawn_once(self, lines: list[StopLine]) -> int:
        key = tuple(line.id for line in lines)
        if key not in self._ways:
            self._ways[key] = self._draw(lines)
        return self._ways[key]

    def _draw(self, lines: list[StopLine]) -> int:
        points: list[Array] = []
        for line in lines:
            for end in line.ends:
                if not points or math.hypot(*(end - points[-1])) > 0.05:
                    points.append(end)
        control = lines[0].control
        nodes = tuple(self._drawn.node(x, y, 0.0) for x, y in np.array(points).tolist())
        gives_way = control.value == "give_way"
        tags = {
            "type": "yield_line" if gives_way else "stop_line",
            "subtype": "dashed" if gives_way else "solid",
            "foretwin:control": f"{control.value} {control.source}",
        }
        return self._drawn.way(nodes, tags)


def _refers(ways: Iterable[int], role: str) -> list[RelationMember]:
    return [RelationMember("way", way, role) for way in ways]


def _rule(subtype: str, **tags: str) -> dict[str, str]:
    return {"type": "regulatory_element", "subtype": subtype, **tags}


def _add_speed_limits(world: World, rules: LaneletRules, drawn: Lanelet2Map) -> None:
    """Add a rule for each limit that the map states; a guess stays a tag of its lanelet."""
    posted: dict[float, list[str]] = {}
    for lane in world.lanes:
        if lane.speed_limit_mps.source == "tagged" and lane.kind in ("driving", "bus"):
            posted.setdefault(round(lane.speed_limit_mps.value * 3.6), []).append(lane.id)
    for kmh, lanes in sorted(posted.items()):
        rules.add(drawn.relation([], _rule("speed_limit", sign_type=f"{kmh} km/h")), lanes)


def _add_lights(
    world: World,
    ids: Mapping[str, int],
    lines: _StopLines,
    rules: LaneletRules,
    drawn: Lanelet2Map,
) -> None:
    """Add one rule for the heads that show one group to the same lanes.

    Connections name it, as Autoware wants it; so does the lane before them where all that
    follow it obey the same heads, as Lanelet2 has it.
    """
    shown = {signal.id: _draw_light(signal, drawn) for signal in world.signals}
    governed: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    heads: dict[tuple[str, str], list[str]] = {}
    for signal in world.signals:
        for lane_id in signal.lane_ids:
            heads.setdefault((signal.group_id, lane_id), []).append(signal.id)
    for (group, lane_id), names in heads.items():
        governed.setdefault((group, tuple(names)), []).append(lane_id)
    groups_at: dict[str, set[str]] = {}
    for group, lane_id in heads:
        groups_at.setdefault(lane_id, set()).add(group)
    following: dict[str, list[Connection]] = {}
    for connection in world.connections:
        if connection.id in ids:
            following.setdefault(connection.from_lane_id, []).append(connection)
    for (group, signals), lane_ids in governed.items():
        line = lines.way(lane_ids)
        members = _refers((shown[name][0] for name in signals), "refers")
        members += _refers((shown[name][1] for name in signals), "light_bulbs")
        members += _refers([] if line is None else [line], "ref_line")
        rule = drawn.relation(members, _rule("traffic_light", **{"foretwin:group": group}))
        named = [
            c.id
            for lane_id in lane_ids
            for c in following.get(lane_id, ())
            if c.signal_group_id in (None, group)
        ]
        rules.add(rule, [*(n for n in lane_ids if n in ids and groups_at[n] == {group}), *named])


def _draw_light(signal: Signal, drawn: Lanelet2Map) -> tuple[int, int]:
    """Draw a light's lower edge, from its left to its right as drivers see it, and its bulbs."""
    x, y, z = signal.position.tolist()
    facing = np.array([math.cos(signal.yaw_rad), math.sin(signal.yaw_rad)])
    left = left_of(-facing) * (LIGHT_WIDTH_M / 2)
    low = z - LIGHT_HEIGHT_M / 2
    edge = (
        drawn.node(x + left[0], y + left[1], low),
        drawn.node(x - left[0], y - left[1], low),
    )
    tags = {
        "type": "traffic_light",
        "subtype": "red_yellow_green",
        "height": f"{LIGHT_HEIGHT_M:.2f}",
        "foretwin:id": signal.id,
        "foretwin:position": signal.source,
    }
    light = drawn.way(edge, tags)
    bulbs = tuple(drawn.node(x, y, low + up, {"color": color}) for color, up in _BULBS)
    return light, drawn.way(bulbs, {"type": "light_bulbs", "traffic_light_id": str(light)})


def _add_all_way_stops(
    world: World,
    junctions: set[str],
    ids: Mapping[str, int],
    lines: _StopLines,
    rules: LaneletRules,
    drawn: Lanelet2Map,
) -> None:
    """Add one rule for each junction at which all stop and go in order of arrival."""
    entering: dict[str, list[str]] = {}
    for connection in world.connections:
        if connection.junction_id in junctions and connection.from_lane_id in ids:
            entering.setdefault(connection.junction_id, []).append(connection.from_lane_id)
    for junction in sorted(entering):
        lanes = list(dict.fromkeys(entering[junction]))
        members = [RelationMember("relation", ids[name], "yield") for name in lanes]
        ways = [lines.way((name,)) for name in lanes]
        if all(way is not None for way in ways):  # one for each lanelet, or none
            members += _refers((way for way in ways if way is not None), "ref_line")
        rules.add(drawn.relation(members, _rule("all_way_stop")), lanes)


def _add_right_of_way(
    world: World,
    without: set[str],
    ids: Mapping[str, int],
    lines: _StopLines,
    rules: LaneletRules,
    drawn: Lanelet2Map,
) -> None:
    """Add, for each connection that waits, a rule at each of its lines with all for which it does.

    Those that no two lights ever let go together are a fallback for when the lights are off.
    """
    connections = {c.id: c for c in world.connections if c.id in ids}
    together = _green_together(world)
    waits: dict[tuple[str, bool, int | None], list[str]] = {}
    for conflict in world.conflicts:
        loser, winner = conflict.yields_id, conflict.goes_id
        if loser not in connections or winner not in connections:
            continue
        if connections[loser].junction_id in without:
            continue
        groups = {connections[n].signal_group_id for n in (loser, winner)}
        fallback = None not in groups and len(groups) == 2 and frozenset(groups) not in together
        line = lines.where_it_waits(connections[loser], conflict)
        waits.setdefault((loser, fallback, line), []).append(winner)
    for (loser, fallback, line), winners in waits.items():
        members = [RelationMember("relation", ids[loser], "yield")]
        members += [RelationMember("relation", ids[name], "right_of_way") for name in winners]
        members += _refers([] if line is None else [line], "ref_line")
        tags = _rule("right_of_way", **({"fallback": "yes"} if fallback else {}))
        rules.add(drawn.relation(members, tags), [loser, *winners])


def _green_together(world: World) -> set[frozenset[str | None]]:
    """Return pairs of groups that some phase lets go at once."""
    plans: list[SignalPlan] = [j.plan for j in world.junctions if j.plan is not None]
    return {
        frozenset((a, b))
        for plan in plans
        for phase in plan.phases
        for a in phase.green_group_ids
        for b in phase.green_group_ids
    }


def _add_crosswalk_rules(
    world: World,
    crosswalks: Mapping[str, int],
    ids: Mapping[str, int],
    lines: _StopLines,
    rules: LaneletRules,
    drawn: Lanelet2Map,
) -> None:
    """Add Autoware's rule for each crosswalk, named by the lanelets that it lies across."""
    if not crosswalks:
        return
    every: list[Lane | Connection] = [*world.lanes, *world.connections]
    parts = [part for part in every if part.id in ids]
    tree = shapely.STRtree([shapely.LineString(part.centerline) for part in parts])
    for crossing in world.crossings:
        met = tree.query(shapely.LineString(crossing.line), predicate="intersects")
        names = [parts[int(i)].id for i in sorted(met.tolist())]
        half = crossing.width_m.value / 2
        band = shapely.LineString(crossing.line).buffer(half, cap_style="flat")
        if not names or band.is_empty:
            continue
        nodes = tuple(drawn.node(x, y, 0.0) for x, y in list(band.exterior.coords)[:-1])
        tags: Tags = {"type": "crosswalk_polygon", "area": "yes"}
        members = [RelationMember("relation", crosswalks[crossing.id], "refers")]
        members += _refers([drawn.way(nodes, tags)], "crosswalk_polygon")
        line = lines.way(names)
        members += _refers([] if line is None else [line], "ref_line")
        rules.add(drawn.relation(members, _rule("crosswalk")), names)
