"""Traffic signs of a CommonRoad scenario: stop, yield, priority and speed limits by country."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

from lxml import etree

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Connection, Lane, World
from foretwin.world_gen.export.commonroad_elements import IdCounter, child, position
from foretwin.world_gen.export.lane_borders import Borders

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
"""The ids that CommonRoad gives the signs of each country that it knows."""
_SIGNED_RULES = frozenset({"stop", "give_way", "priority_road"})


class Signs:
    """Elements of all signs, and which of them hold on each lane or connection."""

    def __init__(self, names: Mapping[SignName, str], ids: IdCounter) -> None:
        self.elements: list[Any] = []
        self._names = names
        self._ids = ids
        self._of: dict[str, list[int]] = {}

    def of(self, name: str) -> Sequence[int]:
        """Return the ids of the signs that hold on a lane or connection."""
        return self._of.get(name, ())

    def add(
        self,
        sign: SignName,
        place: Array,
        lanes: Iterable[str],
        *,
        value: str | None = None,
        virtual: bool = False,
    ) -> None:
        """Put up a sign at a place (2,) for lanes, where the country has such a sign."""
        if sign not in self._names:
            return
        number = self._ids.new()
        element = etree.Element("trafficSign", id=str(number))
        part = child(element, "trafficSignElement")
        child(part, "trafficSignID", self._names[sign])
        if value is not None:
            child(part, "additionalValue", value)
        position(element, place)
        child(element, "virtual", "true" if virtual else "false")
        self.elements.append(element)
        for name in lanes:
            self._of.setdefault(name, []).append(number)


def traffic_signs(
    world: World,
    lanes: Mapping[str, int],
    borders: Mapping[str, Borders],
    country: str,
    ids: IdCounter,
) -> Signs:
    """Return the signs of a World; ValueError where CommonRoad knows none of the country."""
    if country not in SIGNS:
        known = ", ".join(sorted(SIGNS))
        raise ValueError(f"country {country!r}: CommonRoad has traffic signs of {known}")
    signs = Signs(SIGNS[country], ids)
    near_right = world.intersection.driving_side == "right"
    _add_line_signs(world, signs, near_right=near_right)
    _add_priority(world, borders, signs, near_right=near_right)
    _add_speed_limits(world, lanes, borders, signs, near_right=near_right)
    return signs


def _together(lanes: Iterable[Lane]) -> list[list[Lane]]:
    """Return lanes of one road and direction together, each list from its driver's left."""
    groups: dict[tuple[str, bool], list[Lane]] = {}
    for lane in lanes:
        groups.setdefault((lane.road_id or lane.id, lane.reverse), []).append(lane)
    for group in groups.values():
        group.sort(key=lambda lane: lane.left_of_reference_m * (1 if lane.reverse else -1))
    return list(groups.values())


def _add_line_signs(world: World, signs: Signs, *, near_right: bool) -> None:
    lines = {line.across_id: line for line in world.stop_lines}
    names: tuple[SignName, ...] = ("stop", "give_way")
    for sign in names:
        signed = [
            lane
            for lane in world.lanes
            if lane.id in lines and lines[lane.id].control.value == sign
        ]
        for group in _together(signed):
            nearest = group[-1 if near_right else 0]
            line = lines[nearest.id]
            signs.add(
                sign,
                line.ends[1 if near_right else 0],
                [lane.id for lane in group],
                virtual=line.control.source != "tagged",
            )
        for line in world.stop_lines:
            if line.connection_id is not None and line.control.value == sign:
                signs.add(
                    sign,
                    line.ends[1 if near_right else 0],
                    [line.connection_id],
                    virtual=line.control.source != "tagged",
                )


def _add_priority(
    world: World, borders: Mapping[str, Borders], signs: Signs, *, near_right: bool
) -> None:
    """Put up priority signs where others wait by a sign for who comes from a lane without one."""
    connections = {c.id: c for c in world.connections}
    waiting = {
        line.across_id for line in world.stop_lines if line.control.value in ("stop", "give_way")
    }
    first: dict[str, bool] = {}
    for conflict in world.conflicts:
        if conflict.rule not in _SIGNED_RULES:
            continue
        winner = conflict.goes_id
        if winner not in connections:
            continue
        lane_id = connections[winner].from_lane_id
        if waiting.isdisjoint((winner, lane_id)):
            first[lane_id] = first.get(lane_id, False) or conflict.source == "tagged"
    for group in _together(lane for lane in world.lanes if lane.id in first):
        nearest = borders[group[-1 if near_right else 0].id]
        place = (nearest.right if near_right else nearest.left)[-1]
        tagged = any(first[lane.id] for lane in group)
        signs.add("priority", place, [lane.id for lane in group], virtual=not tagged)


def _add_speed_limits(
    world: World,
    lanes: Mapping[str, int],
    borders: Mapping[str, Borders],
    signs: Signs,
    *,
    near_right: bool,
) -> None:
    """Put up a sign where each road begins; connections obey the slower one of their lanes."""
    slower: dict[str, list[Connection]] = {}
    by_id = {lane.id: lane for lane in world.lanes}
    for c in world.connections:
        if c.id in lanes:
            ends = (by_id[c.from_lane_id], by_id[c.to_lane_id])
            lane = min(ends, key=lambda lane: lane.speed_limit_mps.value)
            slower.setdefault(lane.id, []).append(c)
    for group in _together(lane for lane in world.lanes if lane.kind in ("driving", "bus")):
        by_limit: dict[tuple[float, bool], list[Lane]] = {}
        for lane in group:
            limit = lane.speed_limit_mps
            by_limit.setdefault((limit.value, limit.source != "tagged"), []).append(lane)
        for (limit_mps, virtual), members in by_limit.items():
            nearest = borders[members[-1 if near_right else 0].id]
            names = [lane.id for lane in members]
            names += [c.id for lane in members for c in slower.get(lane.id, ())]
            signs.add(
                "max_speed",
                (nearest.right if near_right else nearest.left)[0],
                names,
                value=f"{limit_mps:.4f}",
                virtual=virtual,
            )
