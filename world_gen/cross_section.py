"""The cross-section of a road from its tags: lanes side by side, widths, turns, placement."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from contracts.world import DrivingSide, LaneKind, Provenance, Quantity, Turn
from world_gen.road_graph import RoadEdge

CLASS_WIDTH_M: Mapping[str, float] = {
    "motorway": 3.75,
    "trunk": 3.5,
    "primary": 3.5,
    "secondary": 3.25,
    "tertiary": 3.25,
    "unclassified": 3.0,
    "residential": 3.0,
    "living_street": 2.75,
    "motorway_link": 3.75,
    "trunk_link": 3.5,
    "primary_link": 3.5,
    "secondary_link": 3.5,
    "tertiary_link": 3.25,
    "raceway": 5.0,
}
"""Usual lane widths by highway class; what is not listed gets DEFAULT_WIDTH_M."""
DEFAULT_WIDTH_M = 3.0
BUS_WIDTH_M = 3.25
MIN_WIDTH_M, MAX_WIDTH_M = 2.0, 7.5
MAX_LANES = 12

_TURNS: Mapping[str, Turn | None] = {
    "through": "straight",
    "left": "left",
    "slight_left": "left",
    "sharp_left": "left",
    "right": "right",
    "slight_right": "right",
    "sharp_right": "right",
    "reverse": "u_turn",
    "merge_to_left": "straight",
    "merge_to_right": "straight",
    "slide_left": "straight",
    "slide_right": "straight",
}
_NUMBER = re.compile(r"^\s*(\d+(?:[.,]\d+)?)\s*(m|ft|')?\s*$")


@dataclass(frozen=True, slots=True, kw_only=True)
class LanePlan:
    """One lane of a cross-section.

    `number` counts from the left as its driver sees it; `left_m` is how far its centre lies to
    the left of the way, looking along the way's nodes; `reverse` lanes run against the nodes.
    """

    reverse: bool
    number: int
    kind: LaneKind
    width_m: Quantity
    left_m: float
    turns: tuple[Turn, ...]
    turns_source: Provenance
    direction_source: Provenance


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossSection:
    """Lanes from left to right along the way's nodes, and the carriageway's edges.

    `left_m` and `right_m` are the distances of the edges to the left of the way, so `right_m` is
    usually negative.
    """

    lanes: tuple[LanePlan, ...]
    left_m: float
    right_m: float
    notes: tuple[str, ...]

    @property
    def width_m(self) -> float:
        """Width of the carriageway in metres."""
        return self.left_m - self.right_m

    @property
    def half_width_m(self) -> float:
        """The wider of both sides, measured from the way."""
        return max(abs(self.left_m), abs(self.right_m))

    def reach_m(self, reverse: bool) -> tuple[float, float]:
        """Return how far the middles of the outermost lanes of one direction lie from the way.

        To the left and to the right as their driver sees it; NaN where there are none.
        """
        side = -1.0 if reverse else 1.0
        lefts = [side * lane.left_m for lane in self.lanes if lane.reverse == reverse]
        return (max(lefts), -min(lefts)) if lefts else (math.nan, math.nan)

    def driven(self, *, reverse: bool) -> tuple[LanePlan, ...]:
        """Return the lanes of one direction from the left as their driver sees them."""
        lanes = (lane for lane in self.lanes if lane.reverse == reverse)
        return tuple(sorted(lanes, key=lambda lane: lane.number))


def metres(text: str | None) -> float | None:
    """Return a length tag such as `3.5`, `3,5`, `3 m` or `12 ft` in metres, else None."""
    found = _NUMBER.match(text or "")
    if not found:
        return None
    value = float(found[1].replace(",", "."))
    return value * 0.3048 if found[2] in ("ft", "'") else value


def cross_section(edge: RoadEdge, driving_side: DrivingSide) -> CrossSection:
    """Return the lanes of a road by its tags, by its class where tags are missing."""
    notes: list[str] = []
    forward = _lane_count(edge.lanes_forward) if edge.forward else 0
    backward = _lane_count(edge.lanes_backward) if edge.backward else 0
    ahead = _one_direction(edge, forward, reverse=False, both=backward > 0, notes=notes)
    against = _one_direction(edge, backward, reverse=True, both=forward > 0, notes=notes)
    ahead, against = _fit_total_width(edge, ahead, against)
    ordered = (
        [*reversed(against), *ahead] if driving_side == "right" else [*ahead, *reversed(against)]
    )
    total = sum(lane.width_m.value for lane in ordered)
    left = total / 2 + _placement_shift(edge, ordered, total, notes)
    edge_left, lanes = left, []
    for lane in ordered:
        half = lane.width_m.value / 2
        lanes.append(_moved(lane, left - half))
        left -= 2 * half
    return CrossSection(
        lanes=tuple(lanes), left_m=edge_left, right_m=edge_left - total, notes=tuple(notes)
    )


def _lane_count(lanes: Quantity) -> int:
    return int(min(max(round(lanes.value), 1), MAX_LANES))


def _moved(lane: LanePlan, left_m: float, width_m: Quantity | None = None) -> LanePlan:
    return LanePlan(
        reverse=lane.reverse,
        number=lane.number,
        kind=lane.kind,
        width_m=width_m or lane.width_m,
        left_m=left_m,
        turns=lane.turns,
        turns_source=lane.turns_source,
        direction_source=lane.direction_source,
    )


def _one_direction(
    edge: RoadEdge, count: int, *, reverse: bool, both: bool, notes: list[str]
) -> list[LanePlan]:
    """Return the lanes of one direction, from the left as their driver sees them."""
    if count == 0:
        return []
    tags, side = edge.tags, ("backward" if reverse else "forward")

    def per_lane(key: str) -> list[str] | None:
        text = tags.get(f"{key}:{side}") or (None if both else tags.get(key))
        return text.split("|") if text else None

    bicycle = per_lane("bicycle:lanes") or []
    bus = per_lane("bus:lanes") or per_lane("psv:lanes") or []
    skip = {i for i, word in enumerate(bicycle) if word == "designated"}

    def fitted(values: list[str] | None, what: str) -> list[str] | None:
        if values is None or len(values) == count:
            return values
        without_bicycles = [v for i, v in enumerate(values) if i not in skip]
        if len(without_bicycles) == count:
            return without_bicycles
        notes.append(f"way {edge.way_id}: {what} has {len(values)} entries for {count} lanes")
        return None

    single = tags.get(f"turn:{side}") or (None if both else tags.get("turn"))
    turn_words = fitted(
        per_lane("turn:lanes") or ([single] * count if single else None), "turn:lanes"
    )
    widths = fitted(per_lane("width:lanes"), "width:lanes")
    bus_words = fitted(bus or None, "bus:lanes")
    source: Provenance = "tagged" if "oneway" in tags or "junction" in tags else "inferred"
    lanes = []
    for i in range(count):
        kind: LaneKind = "bus" if bus_words and bus_words[i] == "designated" else "driving"
        turns = _turns(turn_words[i]) if turn_words else ()
        lanes.append(
            LanePlan(
                reverse=reverse,
                number=i,
                kind=kind,
                width_m=_lane_width(edge, widths[i] if widths else None, kind),
                left_m=0.0,
                turns=turns,
                turns_source="tagged" if turn_words and turns else "inferred",
                direction_source=source,
            )
        )
    return lanes


def _turns(words: str) -> tuple[Turn, ...]:
    found = (_TURNS.get(word.strip()) for word in words.split(";"))
    return tuple(dict.fromkeys(turn for turn in found if turn))


def _lane_width(edge: RoadEdge, tagged: str | None, kind: LaneKind) -> Quantity:
    value = metres(tagged)
    if value is not None and MIN_WIDTH_M <= value <= MAX_WIDTH_M:
        return Quantity(value, "tagged")
    if kind == "bus":
        return Quantity(BUS_WIDTH_M, "inferred")
    known = CLASS_WIDTH_M.get(edge.road_class)
    base = Quantity(DEFAULT_WIDTH_M, "default") if known is None else Quantity(known, "inferred")
    ring = edge.tags.get("junction") in ("roundabout", "circular")
    if ring and edge.lanes_forward.value < 1.5:
        # A single ring lane is wide enough for a lorry's swept path (RASt 06: 6.5 to 9 m).
        return Quantity(max(base.value, 4.5), "inferred")
    return base


def _fit_total_width(
    edge: RoadEdge, ahead: list[LanePlan], against: list[LanePlan]
) -> tuple[list[LanePlan], list[LanePlan]]:
    """Spread a tagged total width over lanes whose own width is not tagged."""
    total = metres(edge.tags.get("width")) or metres(edge.tags.get("est_width"))
    lanes = [*ahead, *against]
    if total is None or not lanes or any(lane.width_m.source == "tagged" for lane in lanes):
        return ahead, against
    each = total / len(lanes)
    if not MIN_WIDTH_M <= each <= MAX_WIDTH_M:
        return ahead, against
    # The way's width is tagged, a lane's share of it is worked out; kerb-side parking that the
    # width may include is unknown, so a lane gets no more than 1.5 times its class's width.
    limits = [min(each, 1.5 * lane.width_m.value) for lane in lanes]
    new = [
        _moved(lane, 0.0, Quantity(round(limit, 3), "inferred"))
        for lane, limit in zip(lanes, limits, strict=True)
    ]
    return new[: len(ahead)], new[len(ahead) :]


def _placement_shift(
    edge: RoadEdge, ordered: list[LanePlan], total: float, notes: list[str]
) -> float:
    """Return how far the carriageway's centre lies to the left of the way, from `placement`."""
    tags = edge.tags
    for reverse, key in (
        (False, "placement:forward"),
        (True, "placement:backward"),
        (False, "placement"),
    ):
        text = tags.get(key)
        if text is None or (key == "placement" and not edge.forward) or text == "transition":
            continue
        found = re.match(r"^(left_of|right_of|middle_of):(\d+)$", text.strip())
        lanes = [(i, lane) for i, lane in enumerate(ordered) if lane.reverse == reverse]
        number = int(found[2]) - 1 if found else -1
        place = next((i for i, lane in lanes if lane.number == number), None)
        if found is None or place is None:
            notes.append(f"way {edge.way_id}: {key}={text} names no lane of this road")
            continue
        begin = sum(lane.width_m.value for lane in ordered[:place])
        width = ordered[place].width_m.value
        share = {"left_of": 0.0, "middle_of": 0.5, "right_of": 1.0}[found[1]]
        share = 1.0 - share if reverse else share
        # The way lies `begin + share * width` right of the left edge.
        return begin + share * width - total / 2
    return 0.0
