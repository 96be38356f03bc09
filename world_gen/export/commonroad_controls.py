"""Traffic signs, by country, and lights with their cycles, of a CommonRoad scenario."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array
from foretwin.contracts.signals import SignalPlan
from foretwin.contracts.world import Connection, Lane, Turn, World
from foretwin.world_gen.export.lane_borders import Borders
from foretwin.world_gen.export.lanelets import indicated, slower_lane
from foretwin.world_gen.export.stop_line_lanes import StopLineLanes
from foretwin.world_gen.export.xml_tree import Element, child, element, leaves

SignName = Literal["stop", "give_way", "priority", "max_speed"]
DEFAULT_COUNTRY = "ZAM"
_GERMAN: Mapping[SignName, str] = {
    "stop": "206",
    "give_way": "205",
    "priority": "306",
    "max_speed": "274",
}
SIGNS: Mapping[str, Mapping[SignName, str]] = {
    "ZAM": _GERMAN,
    "DEU": _GERMAN,
    "ESP": {"stop": "r2", "give_way": "r1", "max_speed": "r301"},
    "USA": {"stop": "R1-1", "max_speed": "R2-1"},
    "AUS": {"stop": "R1-1", "give_way": "R1-2"},
    "PRI": {"max_speed": "R2-1"},
    "FRA": {"max_speed": "B14"},
    "BEL": {"max_speed": "C43"},
    "HRV": {"max_speed": "B31"},
    "ARG": {"max_speed": "R15"},
    "RUS": {"max_speed": "3.24"},
    "GRC": {"max_speed": "Ρ-32"},  # noqa: RUF001  the Greek letter is CommonRoad's own
    "ITA": {"max_speed": "274"},
    "CHN": {"max_speed": "274"},
}
"""The ids that CommonRoad gives the signs of each country that it supports."""
_SIGNED_RULES = frozenset({"stop", "give_way", "priority_road"})
_AT_LINES: tuple[SignName, SignName] = ("stop", "give_way")
_FROM_LEFT: tuple[Turn, ...] = ("left", "straight", "right")


class RoadControls:
    """Signs or lights as elements, and which of them hold on each lane or connection."""

    def __init__(self) -> None:
        self.elements: list[Element] = []
        self._of: dict[str, list[str]] = defaultdict(list)

    def of(self, name: str) -> Sequence[str]:
        """Return the ids of those that hold on a lane or connection."""
        return self._of[name]

    def add(self, control: Element, names: Iterable[str]) -> None:
        """Take up a sign or light that holds on lanes or connections."""
        self.elements.append(control)
        for name in names:
            self._of[name].append(str(control.attrib["id"]))


def points(parent: Element, line: Array) -> None:
    """Add the points (N, 2) of a line in metres."""
    for x, y in np.asarray(line, dtype=np.float64).tolist():
        leaves(child(parent, "point"), {"x": f"{x:.3f}", "y": f"{y:.3f}"})


def position(parent: Element, xy_m: Array) -> None:
    """Add the exact place (2,) of a sign or light in metres."""
    points(child(parent, "position"), np.asarray(xy_m)[None, :2])


class _Kerbside:
    """Puts up signs at the kerb side of lanes, where the country has them."""

    def __init__(self, world: World, names: Mapping[SignName, str], ids: Iterator[int]) -> None:
        self.signs = RoadControls()
        self._names = names
        self._ids = ids
        self._near = 1 if world.intersection.driving_side == "right" else 0

    def side(self, left_and_right: Sequence[Array] | Array) -> Array:
        """Return of what lies to the left and to the right that on the kerb side."""
        nearest: Array = left_and_right[self._near]
        return nearest

    def outermost(self, lanes: Sequence[Lane]) -> Lane:
        """Return of lanes from left to right the one by the kerb."""
        return lanes[-self._near]

    def add(
        self, sign: SignName, place: Array, lanes: Iterable[str], *, tagged: bool, value: str = ""
    ) -> None:
        """Put up a sign at a place (2,) for lanes; a virtual one where no tag says so."""
        if sign not in self._names:
            return
        made = element("trafficSign", id=next(self._ids))
        part = child(made, "trafficSignElement")
        child(part, "trafficSignID", self._names[sign])
        if value:
            child(part, "additionalValue", value)
        position(made, place)
        child(made, "virtual", "false" if tagged else "true")
        self.signs.add(made, lanes)


def traffic_signs(
    world: World,
    lanes: Mapping[str, int],
    borders: Mapping[str, Borders],
    country: str,
    ids: Iterator[int],
) -> RoadControls:
    """Return the signs of a World; ValueError where CommonRoad has none of the country."""
    if country not in SIGNS:
        known = ", ".join(sorted(SIGNS))
        raise ValueError(f"country {country!r}: CommonRoad has traffic signs of {known}")
    kerb = _Kerbside(world, SIGNS[country], ids)
    _add_line_signs(world, kerb)
    _add_priority(world, borders, kerb)
    _add_speed_limits(world, lanes, borders, kerb)
    return kerb.signs


def _together(lanes: Iterable[Lane]) -> list[list[Lane]]:
    """Return lanes of one road and direction together, each list from its driver's left."""
    groups: dict[tuple[str, bool], list[Lane]] = defaultdict(list)
    for lane in lanes:
        groups[lane.road_id or lane.id, lane.reverse].append(lane)
    for group in groups.values():
        group.sort(key=lambda lane: lane.left_of_reference_m * (1 if lane.reverse else -1))
    return list(groups.values())


def _add_line_signs(world: World, kerb: _Kerbside) -> None:
    places = StopLineLanes(world)
    for sign in _AT_LINES:
        at = ((places.across(line), line) for line in world.stop_lines)
        lines = {name: line for name, line in at if line.control.value == sign}
        groups = _together(lane for lane in world.lanes if lane.id in lines)
        at_lanes = [
            (lines[kerb.outermost(group).id], [lane.id for lane in group]) for group in groups
        ]
        inside = [(line, [name]) for name, line in lines.items() if line.connection_id is not None]
        for line, names in at_lanes + inside:
            kerb.add(sign, kerb.side(line.ends), names, tagged=line.control.source == "tagged")


def _add_priority(world: World, borders: Mapping[str, Borders], kerb: _Kerbside) -> None:
    """Put up priority signs where others wait by a sign for traffic from a lane without one."""
    start = {c.id: c.from_lane_id for c in world.connections}
    waiting = {line.across_id for line in world.stop_lines if line.control.value in _AT_LINES}
    first: dict[str, bool] = {}
    for conflict in world.conflicts:
        winner = conflict.goes_id
        if conflict.rule not in _SIGNED_RULES or winner not in start:
            continue
        lane_id = start[winner]
        if waiting.isdisjoint((winner, lane_id)):
            first[lane_id] = first.get(lane_id, False) or conflict.source == "tagged"
    for group in _together(lane for lane in world.lanes if lane.id in first):
        place = kerb.side(borders[kerb.outermost(group).id])[-1]
        tagged = any(first[lane.id] for lane in group)
        kerb.add("priority", place, [lane.id for lane in group], tagged=tagged)


def _add_speed_limits(
    world: World, lanes: Mapping[str, int], borders: Mapping[str, Borders], kerb: _Kerbside
) -> None:
    """Put up a sign where each road begins; connections obey the slower one of their lanes."""
    slower: dict[str, list[Connection]] = defaultdict(list)
    by_id = {lane.id: lane for lane in world.lanes}
    for c in world.connections:
        if c.id in lanes:
            slower[slower_lane(by_id[c.from_lane_id], by_id[c.to_lane_id]).id].append(c)
    for group in _together(lane for lane in world.lanes if lane.kind in ("driving", "bus")):
        by_limit: dict[tuple[float, bool], list[Lane]] = defaultdict(list)
        for lane in group:
            limit = lane.speed_limit_mps
            by_limit[limit.value, limit.source == "tagged"].append(lane)
        for (limit_mps, tagged), members in by_limit.items():
            place = kerb.side(borders[kerb.outermost(members).id])[0]
            names = [lane.id for lane in members]
            names += [c.id for lane in members for c in slower[lane.id]]
            kerb.add("max_speed", place, names, value=f"{limit_mps:.4f}", tagged=tagged)


class CycleElement(NamedTuple):
    """A stretch of a light's cycle."""

    color: str
    duration_s: float


def cycle(plan: SignalPlan, group_id: str) -> list[CycleElement]:
    """Return what a group's light shows over one cycle, from the start of its first phase.

    A group that is green in the next phase too stays green between them.
    """
    shown: list[CycleElement] = []

    def show(color: str, duration_s: float) -> None:
        if duration_s <= 0.0:
            return
        if shown and shown[-1].color == color:
            shown[-1] = CycleElement(color, shown[-1].duration_s + duration_s)
        else:
            shown.append(CycleElement(color, duration_s))

    for i, phase in enumerate(plan.phases):
        following = plan.phases[(i + 1) % len(plan.phases)]
        green = group_id in phase.green_group_ids
        stays = green and group_id in following.green_group_ids
        show("green" if green else "red", phase.green_s)
        show("green" if stays else "yellow" if green else "red", plan.amber_s)
        next_green = not green and group_id in following.green_group_ids
        red_amber_s = min(plan.red_amber_s, plan.all_red_s)
        show("green" if stays else "red", plan.all_red_s - red_amber_s)
        show("green" if stays else "redYellow" if next_green else "red", red_amber_s)
    return shown


def traffic_lights(
    world: World, lanes: Mapping[str, int], time_step_s: float, ids: Iterator[int]
) -> RoadControls:
    """Return a light for each head that some lane obeys; one without a plan is not active."""
    of_junctions = (j.plan for j in world.junctions if j.plan is not None)
    known = (*of_junctions, *world.crossing_plans)
    plans = {group.id: plan for plan in known for group in plan.groups}
    lights, places = RoadControls(), StopLineLanes(world)
    for signal in world.signals:
        governed = [name for name in signal.lane_ids if name in lanes]
        if not governed:
            continue
        light = element("trafficLight", id=next(ids))
        plan = plans.get(signal.group_id)
        shown = cycle(plan, signal.group_id) if plan is not None else []
        parent = child(light, "cycle")
        for color, duration_s in shown or [CycleElement("inactive", time_step_s)]:
            part = child(parent, "cycleElement")
            child(part, "duration", max(round(duration_s / time_step_s), 1))
            child(part, "color", color)
        position(light, signal.position)
        child(light, "direction", _direction(world, governed, signal.group_id))
        child(light, "active", "true" if shown else "false")
        lights.add(light, dict.fromkeys(places.of_head(signal, name) for name in governed))
    return lights


def _direction(world: World, lane_ids: Sequence[str], group_id: str) -> str:
    """Return for which turns a light stands, by the connections of its group; for all if none."""
    side = world.intersection.driving_side
    turns = {
        indicated(c.turn, side)
        for c in world.connections
        if c.from_lane_id in lane_ids and c.signal_group_id == group_id
    }
    words = [turn for turn in _FROM_LEFT if turn in turns]
    return words[0] + "".join(word.title() for word in words[1:]) if 0 < len(words) < 3 else "all"
