"""The lanes of one direction of a road, from its tags that name them one by one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from foretwin.contracts.provenance import Provenance, Quantity
from foretwin.contracts.world import LaneChange, LaneKind, Turn
from foretwin.world_gen.countries.rules import rules_of
from foretwin.world_gen.lanes.lane_plans import LanePlan, of_side, tagged_width
from foretwin.world_gen.lanes.side_lanes import BICYCLE_WIDTH_M
from foretwin.world_gen.roads.road_classes import road_class
from foretwin.world_gen.roads.road_graph import RoadEdge
from foretwin.world_gen.roads.road_tags import is_tidal
from foretwin.world_gen.roads.speed_limits import posted_limit

DEFAULT_WIDTH_M = 3.0
BUS_WIDTH_M = 3.25
MIN_WIDTH_M, MAX_WIDTH_M = 2.0, 7.5

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
_CHANGES: Mapping[str, LaneChange] = {
    "yes": "both",
    "no": "none",
    "not_left": "right",
    "only_right": "right",
    "not_right": "left",
    "only_left": "left",
}
_ALLOWED = frozenset({"designated", "yes"})
_BUSES_ALONE = frozenset({"psv", "bus"})
_CLOSED = frozenset({"no", "private"})


class Direction:
    """Tags of one direction of a road, as values for each of its lanes."""

    def __init__(
        self, edge: RoadEdge, count: int, *, reverse: bool, both: bool, notes: list[str]
    ) -> None:
        self.edge, self.count, self.reverse, self.both = edge, count, reverse, both
        self.notes = notes
        self.word = "backward" if reverse else "forward"
        self.bicycle = self.each("bicycle:lanes")
        self.designated = [i for i, word in enumerate(self.bicycle) if word == "designated"]

    def text(self, key: str) -> str | None:
        """Return a tag of this direction; the tag without a direction holds for one-ways."""
        tags = self.edge.tags
        return tags.get(f"{key}:{self.word}") or (None if self.both else tags.get(key))

    def each(self, key: str) -> list[str]:
        """Return a tag's values lane by lane from the left, none where it is missing."""
        text = self.text(key)
        return [value.strip() for value in text.split("|")] if text else []

    def fitted(self, *keys: str, default: str | None = None) -> list[str]:
        """Return for each counted lane its value of the first tag that fits, or the default.

        It is noted where one does not fit.
        """
        for key in keys:
            values = self.each(key)
            cars = [value for i, value in enumerate(values) if i not in self.designated]
            for fitting in (values, cars):
                if len(fitting) == self.count:
                    return fitting
            if values:
                self.notes.append(
                    f"way {self.edge.way_id}: {key} has {len(values)} entries for "
                    f"{self.count} lanes"
                )
        return [default or ""] * self.count


def lanes_of_direction(
    edge: RoadEdge,
    count: int,
    *,
    reverse: bool,
    both: bool,
    notes: list[str],
) -> list[LanePlan]:
    """Return the lanes of one direction from the left as their driver sees them.

    `count` lanes are counted; bicycle lanes that the tags put among them come on top. `both`
    tells that the road is driven both ways.
    """
    if count == 0:
        return []
    tags = Direction(edge, count, reverse=reverse, both=both, notes=notes)
    beside = tags.designated if len(tags.bicycle) == count + len(tags.designated) else []
    turns = tags.fitted("turn:lanes", default=tags.text("turn"))
    widths = tags.fitted("width:lanes")
    changes = tags.fitted("change:lanes", default=tags.text("change"))
    limits = tags.fitted("maxspeed:lanes")
    kinds = _kinds(tags)
    tagged = "oneway" in edge.tags or "junction" in edge.tags
    source: Provenance = "tagged" if tagged else "inferred"
    source = "default" if is_tidal(edge.tags) else source
    letter = "b" if reverse else "f"
    lanes = []
    for i in range(count):
        arrows = tuple(word.strip() for word in turns[i].split(";"))
        named = _turns(arrows)
        change = _CHANGES.get(changes[i])
        lanes.append(
            LanePlan(
                label=f"{letter}{i}",
                reverse=reverse,
                number=i,
                kind=kinds[i],
                width_m=_lane_width(edge, widths[i], kinds[i]),
                turns=named,
                turns_source="tagged" if named else "inferred",
                arrows=arrows if named else (),
                direction_source=source,
                change=change or "both",
                change_source="tagged" if change else "default",
                # Counted, as the map counts it, but cars have no business there.
                counted=kinds[i] in ("driving", "bus"),
                speed_limit_mps=posted_limit(limits[i]),
            )
        )
    for place in beside:
        lanes.insert(
            place,
            LanePlan(
                label=f"bicycle_{letter}{place}",
                reverse=reverse,
                number=-10 - place,
                kind="bicycle",
                width_m=Quantity(BICYCLE_WIDTH_M, "default"),
                direction_source=source,
                counted=False,
            ),
        )
    return lanes


def _kinds(tags: Direction) -> list[LaneKind]:
    """Return what each counted lane is for."""
    count, bicycle = tags.count, tags.bicycle
    kinds: list[LaneKind] = ["driving"] * count
    bus = tags.fitted("bus:lanes", "psv:lanes")
    barred = tags.fitted("motor_vehicle:lanes", "vehicle:lanes", "access:lanes")
    for i in range(count):
        closed = barred[i] in _CLOSED
        if bus[i] == "designated" or barred[i] in _BUSES_ALONE or (closed and bus[i] in _ALLOWED):
            kinds[i] = "bus"
        elif closed and len(bicycle) == count and bicycle[i] in _ALLOWED:
            kinds[i] = "bicycle"
        elif closed:
            kinds[i] = "closed"
    if "bus" not in kinds and not any(bus):
        outermost = min(_outer_bus_lanes(tags), count - 1)
        for k in range(outermost):
            kinds[count - 1 - k if tags.edge.driving_side == "right" else k] = "bus"
    if "driving" not in kinds and "busway" not in tags.edge.road_class:
        tags.notes.append(f"way {tags.edge.way_id}: no lane is left for cars; taken as for all")
        return ["driving"] * count
    return kinds


def _outer_bus_lanes(tags: Direction) -> int:
    """Return how many lanes at the kerb are for buses, from tags that only count them."""
    for key in ("lanes:bus", "lanes:psv"):
        text = tags.text(key)
        if text and text.isdigit():
            return int(text)
    kerb: str = tags.edge.driving_side
    if tags.reverse:
        kerb = "left" if kerb == "right" else "right"
    return int(of_side(tags.edge.tags, "busway", kerb) == "lane")


def _turns(words: Iterable[str]) -> tuple[Turn, ...]:
    found = (_TURNS.get(word) for word in words)
    return tuple(dict.fromkeys(turn for turn in found if turn))


def _lane_width(edge: RoadEdge, tagged: str, kind: LaneKind) -> Quantity:
    least = 0.8 if kind == "bicycle" else MIN_WIDTH_M
    if width := tagged_width(tagged, least, MAX_WIDTH_M):
        return width
    if kind == "bus":
        return Quantity(BUS_WIDTH_M, "default")
    if kind == "bicycle":
        return Quantity(BICYCLE_WIDTH_M, "default")
    usual_m = usual_width_m(edge)
    ring = edge.tags.get("junction") in ("roundabout", "circular")
    if ring and edge.lanes_forward.value < 1.5:
        # A single ring lane is wide enough for a lorry's swept path (RASt 06: 6.5 to 9 m).
        usual_m = max(usual_m, 4.5)
    return Quantity(usual_m, "default")


def usual_width_m(edge: RoadEdge) -> float:
    """Return how wide a lane of a road's class is in its country."""
    of_class = road_class(edge.road_class).lane_width_m or DEFAULT_WIDTH_M
    return rules_of(edge.country).width_m(edge.road_class, of_class)
