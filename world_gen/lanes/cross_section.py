"""The cross-section of a road from its tags: lanes side by side, widths, turns, placement."""

from __future__ import annotations

import re

import msgspec

from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.lanes.lane_plans import CrossSection, LanePlan, metres
from foretwin.world_gen.lanes.lane_tags import (
    BUS_WIDTH_M,
    MAX_WIDTH_M,
    MIN_WIDTH_M,
    lanes_of_direction,
    usual_width_m,
)
from foretwin.world_gen.lanes.side_lanes import SideLanes, side_lanes
from foretwin.world_gen.roads.road_graph import RoadEdge

MAX_LANES = 12
PASSING_M = 4.75
"""Two cars pass each other on a road so wide (RASt 06: car meets car)."""
LEAST_HALF_M = 1.25
"""Half of the narrowest road that a car of 1.9 m drives with some room."""
_ONE_EACH_WAY = ([True, False], [False, True])
TRANSITION = "transition"
_PLACEMENT = re.compile(r"^(left_of|right_of|middle_of):(\d+)$")


def cross_section(edge: RoadEdge, *, centre_reverse: bool = False) -> CrossSection:
    """Return the lanes of a road by its tags, by its class where tags are missing.

    The way lies in the middle of the lanes that the map counts, unless `placement` is
    otherwise; lanes for bicycles and parking lie outside. A lane in the middle from which both
    directions turn becomes one lane, driven along the way, or against it with `centre_reverse`.
    """
    notes: list[str] = []
    forward = _lane_count(edge.lanes_forward) if edge.forward else 0
    backward = _lane_count(edge.lanes_backward) if edge.backward else 0
    ahead = lanes_of_direction(edge, forward, reverse=False, both=backward > 0, notes=notes)
    against = lanes_of_direction(edge, backward, reverse=True, both=forward > 0, notes=notes)
    centre = _centre(edge, centre_reverse, notes) if ahead and against else []
    with_bicycles = frozenset(p.reverse for p in (*ahead, *against) if p.kind == "bicycle")
    beside = side_lanes(edge, with_bicycles, BUS_WIDTH_M)
    first, last = against[::-1], ahead
    if edge.driving_side == "left":
        first, last = last, first
    ordered = [*first, *centre, *last]
    if _is_shared(edge, ordered):
        ordered = _halves(edge, ordered, notes)
    else:
        ordered, beside = _fit_total_width(edge, ordered, beside, notes)
    total = _width(ordered)
    left = total / 2 + _placement_shift(edge, ordered, total, notes)
    left += _width(beside.left)
    edge_left, lanes = left, []
    for lane in (*reversed(beside.left), *ordered, *beside.right):
        half = lane.width_m.value / 2
        lanes.append(msgspec.structs.replace(lane, left_m=left - half))
        left -= 2 * half
    return CrossSection(lanes=tuple(lanes), left_m=edge_left, right_m=left, notes=tuple(notes))


def widened(section: CrossSection, factor: float) -> CrossSection:
    """Return a section whose lanes are so many times as wide, as passes say they are.

    It stays as it is where a width is tagged, where other lanes than those of cars lie in it, and
    where lanes would become too wide or narrow.
    """
    wider = [
        msgspec.structs.replace(
            lane,
            width_m=Quantity(round(lane.width_m.value * factor, 3), "driven"),
            left_m=lane.left_m * factor,
        )
        for lane in section.lanes
        if lane.counted and lane.width_m.source == "default"
    ]
    fits = all(MIN_WIDTH_M <= lane.width_m.value <= MAX_WIDTH_M for lane in wider)
    if len(wider) < len(section.lanes) or not fits:
        return section
    left_m, right_m = section.left_m * factor, section.right_m * factor
    return CrossSection(lanes=tuple(wider), left_m=left_m, right_m=right_m, notes=section.notes)


def _lane_count(lanes: Quantity) -> int:
    return int(min(max(round(lanes.value), 1), MAX_LANES))


def _width(lanes: list[LanePlan] | tuple[LanePlan, ...]) -> float:
    return sum(lane.width_m.value for lane in lanes)


def _centre(edge: RoadEdge, reverse: bool, notes: list[str]) -> list[LanePlan]:
    """Return the lane in the middle from which both directions turn, where there is one."""
    if edge.tags.get("lanes:both_ways", "0") in ("0", "no"):
        return []
    tagged = "turn:lanes:both_ways" in edge.tags or "turn:both_ways" in edge.tags
    notes.append(
        f"way {edge.way_id}: its centre lane, for turns from both directions, is driven one way"
    )
    return [
        LanePlan(
            label="centre",
            reverse=reverse,
            number=-1,
            kind="driving",
            width_m=Quantity(usual_width_m(edge), "default"),
            turns=("left",) if edge.driving_side == "right" else ("right",),
            turns_source="tagged" if tagged else "inferred",
            counted=False,
        )
    ]


def _is_shared(edge: RoadEdge, lanes: list[LanePlan]) -> bool:
    """Return whether both directions have but one lane, on which cars cannot pass each other.

    That is what `lanes=1` says, or where no tag counts lanes a width that holds no two.
    """
    if [lane.reverse for lane in lanes] not in _ONE_EACH_WAY:
        return False
    if any(lane.width_m.source == "tagged" for lane in lanes):
        return False
    total_m = _tagged_total_m(edge)
    if edge.tags.get("lanes") == "1":
        return total_m is None or total_m < PASSING_M
    counted = {edge.lanes_forward.source, edge.lanes_backward.source} != {"default"}
    return not counted and total_m is not None and total_m < 2.0 * MIN_WIDTH_M


def _halves(edge: RoadEdge, lanes: list[LanePlan], notes: list[str]) -> list[LanePlan]:
    """Return the two directions of one lane, each with half of its width."""
    notes.append(f"way {edge.way_id}: one lane for both directions; each has half of its width")
    total_m = _tagged_total_m(edge)
    least_m = max(total_m or usual_width_m(edge), 2.0 * LEAST_HALF_M)
    half = Quantity(least_m / 2.0, "default" if total_m is None else "inferred")
    return [msgspec.structs.replace(lane, width_m=half) for lane in lanes]


def _tagged_total_m(edge: RoadEdge) -> float | None:
    return metres(edge.tags.get("width")) or metres(edge.tags.get("est_width"))


def _fit_total_width(
    edge: RoadEdge, lanes: list[LanePlan], beside: SideLanes, notes: list[str]
) -> tuple[list[LanePlan], SideLanes]:
    """Spread a tagged total width over lanes whose own width is not tagged.

    It reaches from kerb to kerb (https://wiki.openstreetmap.org/wiki/Key:width) and holds the
    bicycle lanes beside them. Where it is less than is usual for all of them, bicycle lanes are
    narrower in proportion.
    """
    total = _tagged_total_m(edge)
    if total is None or not lanes or any(lane.width_m.source == "tagged" for lane in lanes):
        return lanes, beside
    cars = [lane for lane in lanes if lane.kind != "bicycle"]
    bicycles = [p for p in (*lanes, *beside.left, *beside.right) if p.kind == "bicycle"]
    free = [lane for lane in bicycles if lane.width_m.source != "tagged"]
    rest_m = total - _width([lane for lane in bicycles if lane.width_m.source == "tagged"])
    narrowed = min(1.0, rest_m / _width([*cars, *free]))
    each = (rest_m - narrowed * _width(free)) / max(len(cars), 1)
    if each < MIN_WIDTH_M:
        notes.append(
            f"way {edge.way_id}: its width of {total:g} m does not fit its lanes; not used"
        )
        return lanes, beside
    # The way's width is tagged, a lane's share of it is worked out; kerb-side parking that the
    # width may include is unknown, so a lane gets no more than 1.5 times its class's width.
    fitted = {lane.label: min(each, 1.5 * lane.width_m.value, MAX_WIDTH_M) for lane in cars}
    if any(width_m < each for width_m in fitted.values()):
        notes.append(f"way {edge.way_id}: its lanes need less than its width of {total:g} m")
    if narrowed < 1.0:
        fitted |= {lane.label: narrowed * lane.width_m.value for lane in free}

    def fit(lane: LanePlan) -> LanePlan:
        if lane.label not in fitted:
            return lane
        width_m = Quantity(round(fitted[lane.label], 3), "inferred")
        return msgspec.structs.replace(lane, width_m=width_m)

    left, right = (tuple(map(fit, side)) for side in beside)
    return [*map(fit, lanes)], SideLanes(left, right)


def _placement_shift(
    edge: RoadEdge, ordered: list[LanePlan], total: float, notes: list[str]
) -> float:
    """Return how far the carriageway's centre lies to the left of the way, from `placement`."""
    tags = edge.tags
    for key in ("placement:forward", "placement:backward", "placement"):
        reverse = key == "placement:backward"
        text = tags.get(key)
        if text is None or (key == "placement" and not edge.forward) or text == TRANSITION:
            continue
        found = _PLACEMENT.match(text.strip())
        number = int(found[2]) - 1 if found else -1
        meant = [
            i for i, lane in enumerate(ordered) if (lane.reverse, lane.number) == (reverse, number)
        ]
        if found is None or number < 0 or not meant:
            notes.append(f"way {edge.way_id}: {key}={text} names no lane of this road")
            continue
        begin = _width(ordered[: meant[0]])
        width = ordered[meant[0]].width_m.value
        share = {"left_of": 0.0, "middle_of": 0.5, "right_of": 1.0}[found[1]]
        share = 1.0 - share if reverse else share
        # The way lies `begin + share * width` right of the left edge.
        return begin + share * width - total / 2
    return 0.0
