"""Regulatory elements of a Lanelet2 map: lights, right of way, all-way stops, speed limits."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, product

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.signals import Signal
from foretwin.contracts.world import Conflict, Connection, Lane, StopLine, World
from foretwin.geometry.polyline import left_of
from foretwin.world_gen.export.lanelet2_primitives import Lanelet2Map, MemberKind, RelationMember
from foretwin.world_gen.export.stop_line_lanes import StopLineLanes, middle_of, nearest

LIGHT_WIDTH_M = 0.35
LIGHT_HEIGHT_M = 0.9
STOP_BEFORE_M = 10.0
"""A stop line farther from a crossing is not that crossing's."""
_BULBS = (("red", 0.75), ("yellow", 0.45), ("green", 0.15))
"""Colours and heights over the light's lower edge."""


def add_rules(
    world: World, ids: Mapping[str, int], crosswalks: Mapping[str, int], drawn: Lanelet2Map
) -> Mapping[str, Sequence[int]]:
    """Add every regulatory element, and return those that each lane or connection names.

    `ids` are lanelets by the World's ids, as are `crosswalks`.
    """
    rules = _Rules(world, ids, drawn)
    rules.add_speed_limits()
    rules.add_lights()
    all_way = {j.summary.id for j in world.junctions if j.summary.control == "all_way_stop"}
    rules.add_all_way_stops(all_way)
    rules.add_right_of_way(all_way)
    if crosswalks:
        rules.add_crosswalk_rules(crosswalks)
    return rules.of


class _StopLines:
    """Stop lines as ways, drawn when a rule first needs them."""

    def __init__(self, world: World, drawn: Lanelet2Map) -> None:
        self._drawn = drawn
        self.of_lane: dict[str, list[StopLine]] = defaultdict(list)
        """Those of each lane, as its driver meets them: a light may stand before a sign."""
        self._at_sign = {
            line.connection_id: line for line in world.stop_lines if line.connection_id
        }
        self._ways: dict[tuple[str, ...], int] = {}
        for line in world.stop_lines:
            if line.control.value != "none" and line.connection_id is None:
                self.of_lane[line.lane_id].append(line)
        lanes = {lane.id: lane for lane in world.lanes}
        for name, lines in self.of_lane.items():
            if len(lines) > 1:
                path = shapely.LineString(lanes[name].centerline)
                along_m = shapely.line_locate_point(path, [middle_of(line) for line in lines])
                lines[:] = [lines[i] for i in np.argsort(along_m)]
            for line in lines:
                if line.control.value != "signal":
                    self.drawn_once([line])

    def where_it_waits(self, connection: Connection, conflict: Conflict) -> int | None:
        """Return the last line before the ground that a connection shares with another."""
        line = self._at_sign.get(connection.id)
        if line is not None:
            path = shapely.LineString(connection.centerline)
            shared = path.project(shapely.points(conflict.area))
            if np.min(shared) > path.project(middle_of(line)):
                return self.drawn_once([line])
        return self.way((connection.from_lane_id,))

    def way(self, lane_ids: Iterable[str], head: Signal | None = None) -> int | None:
        """Return one line across all these lanes that have a stop line, from left to right.

        That is the last one of each lane, or that of a light.
        """
        known = [self.of_lane[name] for name in lane_ids if name in self.of_lane]
        mine = [lines[-1] if head is None else nearest(head, lines) for lines in known]
        if not mine:
            return None
        across = mine[0].ends[1] - mine[0].ends[0]
        mine.sort(key=lambda line: float(line.ends[0] @ across))
        return self.drawn_once(mine)

    def drawn_once(self, lines: list[StopLine]) -> int:
        """Return the way of lines that lie side by side."""
        key = tuple(line.id for line in lines)
        if key not in self._ways:
            self._ways[key] = self._draw(lines)
        return self._ways[key]

    def _draw(self, lines: list[StopLine]) -> int:
        points: list[Array] = []
        for end in (end for line in lines for end in line.ends):
            if not points or math.hypot(*(end - points[-1])) > 0.05:
                points.append(end)
        control = lines[0].control
        gives_way = control.value == "give_way"
        tags = {
            "type": "yield_line" if gives_way else "stop_line",
            "subtype": "dashed" if gives_way else "solid",
            "foretwin:control": f"{control.value} {control.source}",
        }
        return self._drawn.way(self._drawn.ground_nodes(np.array(points)), tags)


class _Rules:
    """Adds rules to a map and gathers which of them each lane or connection names."""

    def __init__(self, world: World, ids: Mapping[str, int], drawn: Lanelet2Map) -> None:
        self.of: dict[str, list[int]] = defaultdict(list)
        self._world, self._ids, self._drawn = world, ids, drawn
        self._lines = _StopLines(world, drawn)

    def _add(
        self, subtype: str, members: Sequence[RelationMember], names: Iterable[str], **tags: str
    ) -> None:
        """Add a rule that lanelets, by the World's ids, name once each."""
        tags = {"type": "regulatory_element", "subtype": subtype, **tags}
        rule = self._drawn.relation(members, tags)
        for name in dict.fromkeys(names):
            self.of[name].append(rule)

    def add_speed_limits(self) -> None:
        """Add a rule for each limit that the map states; a guess stays a tag of its lanelet."""
        posted: dict[int, list[str]] = defaultdict(list)
        for lane in self._world.lanes:
            if lane.speed_limit_mps.source == "tagged" and lane.kind in ("driving", "bus"):
                posted[round(lane.speed_limit_mps.value * 3.6)].append(lane.id)
        for kmh, lanes in sorted(posted.items()):
            self._add("speed_limit", [], lanes, sign_type=f"{kmh} km/h")

    def add_lights(self) -> None:
        """Add one rule for the heads that show one group to the same lanes.

        Connections that obey it name it, as Autoware wants it; so does the lane before them where
        all that follow it do, as Lanelet2 has it, and that of a light away from junctions.
        """
        shown = {signal.id: _draw_light(signal, self._drawn) for signal in self._world.signals}
        signal_of = {signal.id: signal for signal in self._world.signals}
        places = StopLineLanes(self._world)
        heads: dict[tuple[str, str], list[str]] = defaultdict(list)
        for signal in self._world.signals:
            for lane_id in signal.lane_ids:
                heads[signal.group_id, lane_id].append(signal.id)
        governed: dict[tuple[str, tuple[str, ...]], list[str]] = defaultdict(list)
        for (group, lane_id), names in heads.items():
            governed[group, tuple(names)].append(lane_id)
        following: dict[str, list[Connection]] = defaultdict(list)
        for connection in self._world.connections:
            if connection.id in self._ids:
                following[connection.from_lane_id].append(connection)
        for (group, signals), lane_ids in governed.items():
            head = signal_of[signals[0]]
            line = self._lines.way(lane_ids, head)
            members = _members("way", "refers", (shown[name][0] for name in signals))
            members += _members("way", "light_bulbs", (shown[name][1] for name in signals))
            members += _members("way", "ref_line", [line])
            obeying = {
                name: [c.id for c in following[name] if c.signal_group_id == group]
                for name in lane_ids
            }
            named = [
                places.of_head(head, name)
                for name, mine in obeying.items()
                if name in self._ids and len(mine) in (0, len(following[name]))
            ]
            named += chain.from_iterable(obeying.values())
            self._add("traffic_light", members, named, **{"foretwin:group": group})

    def add_all_way_stops(self, junctions: set[str]) -> None:
        """Add one rule for each junction at which all stop and go in order of arrival."""
        entering: dict[str, list[str]] = defaultdict(list)
        for connection in self._world.connections:
            if connection.junction_id in junctions and connection.from_lane_id in self._ids:
                entering[connection.junction_id].append(connection.from_lane_id)
        for _, names in sorted(entering.items()):
            lanes = list(dict.fromkeys(names))
            members = _members("relation", "yield", (self._ids[name] for name in lanes))
            ways = [self._lines.way((name,)) for name in lanes]
            if None not in ways:  # one for each lanelet, or none
                members += _members("way", "ref_line", ways)
            self._add("all_way_stop", members, lanes)

    def add_right_of_way(self, without: set[str]) -> None:
        """Add, for each connection that waits, a rule at each of its lines with all that go first.

        Those that no two lights ever let go together are a fallback for when the lights are off.
        Connections of junctions `without` have rules of another kind.
        """
        connections = {c.id: c for c in self._world.connections if c.id in self._ids}
        together = _green_together(self._world)
        waits: dict[tuple[str, bool, int | None], list[str]] = defaultdict(list)
        for conflict in self._world.conflicts:
            loser, winner = connections.get(conflict.yields_id), connections.get(conflict.goes_id)
            if loser is None or winner is None or loser.junction_id in without:
                continue
            groups = {loser.signal_group_id, winner.signal_group_id}
            fallback = None not in groups and len(groups) == 2 and groups not in together
            line = self._lines.where_it_waits(loser, conflict)
            waits[loser.id, fallback, line].append(winner.id)
        for (name, fallback, line), winners in waits.items():
            members = _members("relation", "yield", [self._ids[name]])
            members += _members("relation", "right_of_way", (self._ids[n] for n in winners))
            members += _members("way", "ref_line", [line])
            tags = {"fallback": "yes"} if fallback else {}
            self._add("right_of_way", members, [name, *winners], **tags)

    def add_crosswalk_rules(self, crosswalks: Mapping[str, int]) -> None:
        """Add Autoware's rule for each crosswalk, named by the lanelets that it lies across.

        Its lines are the stop lines close before it: lines at which one gives way are no
        stop lines to Autoware.
        """
        every: list[Lane | Connection] = [*self._world.lanes, *self._world.connections]
        parts = [part for part in every if part.id in self._ids]
        middles = [shapely.LineString(part.centerline) for part in parts]
        widths = [part.width_m.value / 2 for part in parts]
        middle_tree = shapely.STRtree(middles)
        ground_tree = shapely.STRtree(shapely.buffer(middles, widths, cap_style="flat"))
        for crossing in self._world.crossings:
            line = shapely.LineString(crossing.line)
            band = line.buffer(crossing.width_m.value / 2, cap_style="flat")
            met = middle_tree.query(line, predicate="intersects").tolist()
            # A crossing of a cycle lane, or one drawn short, may reach no lane's middle.
            met = met or ground_tree.query(band, predicate="intersects").tolist()
            named = [parts[i] for i in sorted(met)]
            members = _members("relation", "refers", [crosswalks[crossing.id]])
            if not band.is_empty:
                corners = self._drawn.ground_nodes(shapely.get_coordinates(band.exterior)[:-1])
                outline = self._drawn.way(corners, {"type": "crosswalk_polygon", "area": "yes"})
                members += _members("way", "crosswalk_polygon", [outline])
            members += _members("way", "ref_line", self._stop_lines_before(line, named))
            self._add("crosswalk", members, [part.id for part in named])

    def _stop_lines_before(
        self, crossing: shapely.LineString, parts: Iterable[Lane | Connection]
    ) -> list[int | None]:
        """Return the stop lines close to a crossing, of the lanes that lead over it."""
        lanes = dict.fromkeys(
            part.from_lane_id if isinstance(part, Connection) else part.id for part in parts
        )
        near = [
            line
            for name in lanes
            for line in self._lines.of_lane.get(name, ())
            if line.control.value != "give_way"
            and shapely.distance(crossing, shapely.LineString(line.ends)) <= STOP_BEFORE_M
        ]
        return [self._lines.drawn_once([line]) for line in near]


def _members(kind: MemberKind, role: str, refs: Iterable[int | None]) -> list[RelationMember]:
    """Return members of one role, without those that are None."""
    return [RelationMember(kind, ref, role) for ref in refs if ref is not None]


def _draw_light(signal: Signal, drawn: Lanelet2Map) -> tuple[int, int]:
    """Draw a light's lower edge, from its left to its right as drivers see it, and its bulbs."""
    x, y, z = signal.position.tolist()
    facing = np.array([math.cos(signal.yaw_rad), math.sin(signal.yaw_rad)])
    left = left_of(-facing) * (LIGHT_WIDTH_M / 2)
    low = z - LIGHT_HEIGHT_M / 2 + float(drawn.ground_m(signal.position[None, :2])[0])
    edge = [drawn.node(x + side * left[0], y + side * left[1], low) for side in (1.0, -1.0)]
    tags = {
        "type": "traffic_light",
        "subtype": "red_yellow_green",
        "height": f"{LIGHT_HEIGHT_M:.2f}",
        "foretwin:id": signal.id,
        "foretwin:position": signal.source,
    }
    light = drawn.way(tuple(edge), tags)
    bulbs = tuple(drawn.node(x, y, low + up, {"color": color}) for color, up in _BULBS)
    return light, drawn.way(bulbs, {"type": "light_bulbs", "traffic_light_id": str(light)})


def _green_together(world: World) -> set[frozenset[str | None]]:
    """Return pairs of groups that some phase lets go at once."""
    phases = (phase for j in world.junctions if j.plan is not None for phase in j.plan.phases)
    pairs = (product(phase.green_group_ids, repeat=2) for phase in phases)
    return {frozenset(pair) for pair in chain.from_iterable(pairs)}
