"""Lanes beside those that cars drive on: for bicycles, for parking, for buses the other way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from foretwin.contracts.provenance import Quantity
from foretwin.contracts.world import LaneKind
from foretwin.world_gen.lanes.lane_plans import LanePlan, of_side, tagged_width
from foretwin.world_gen.roads.road_graph import RoadEdge

BICYCLE_WIDTH_M = 1.85
"""Usual width of a bicycle lane with its line (RASt 06)."""
PARKING_WIDTH_M: Mapping[str, float] = {"parallel": 2.0, "diagonal": 4.5, "perpendicular": 5.0}
_PARKED = frozenset({"lane", "street_side"})
_OLD_ON_STREET = frozenset({"on_street", "lay_by", "street_side", "painted_area_only"})
_AGAINST = frozenset({"-1", "no"})


class SideLanes(NamedTuple):
    """Lanes beyond the outermost counted ones, from the road's middle outward."""

    left: tuple[LanePlan, ...]
    right: tuple[LanePlan, ...]


_NUMBERS: Mapping[tuple[LaneKind, str], int] = {
    ("bicycle", "left"): -2,
    ("bicycle", "right"): -3,
    ("parking", "left"): -4,
    ("parking", "right"): -5,
    ("bus", "left"): -6,
    ("bus", "right"): -7,
}
_KEYS = ("cycleway", "parking:", "busway")


def side_lanes(edge: RoadEdge, with_bicycles: frozenset[bool], bus_width_m: float) -> SideLanes:
    """Return the lanes at the kerbs; `with_bicycles` names directions that have theirs already."""
    if not any(key.startswith(_KEYS) for key in edge.tags):
        return SideLanes((), ())
    left, right = (_of_side(edge, side, with_bicycles, bus_width_m) for side in ("left", "right"))
    return SideLanes(tuple(left), tuple(right))


def _of_side(
    edge: RoadEdge, side: str, with_bicycles: frozenset[bool], bus_width_m: float
) -> list[LanePlan]:
    tags = edge.tags
    one_way = edge.one_way
    kerb_of_forward = side == edge.driving_side
    # Along a one-way street both kerbs belong to its direction.
    reverse = edge.backward if one_way else not kerb_of_forward
    found: list[LanePlan] = []
    opposite = one_way and (kerb_of_forward == edge.backward)
    if opposite and of_side(tags, "busway", side) == "opposite_lane":
        width = Quantity(bus_width_m, "default")
        found.append(_lane(side, "bus", width, not reverse))
    word = of_side(tags, "cycleway", side)
    against = opposite and (
        word == "opposite_lane"
        or of_side(tags, "cycleway", side, ":oneway") in _AGAINST
        or (f"cycleway:{side}" in tags and tags.get("oneway:bicycle") == "no")
    )
    # `cycleway=lane` on a one-way street is a lane at the kerb of its own direction.
    meant = against or not one_way or not opposite
    meant = meant or f"cycleway:{side}" in tags or "cycleway:both" in tags
    mine = word == "lane" and meant
    runs = not reverse if against else reverse
    if (mine or (against and word == "opposite_lane")) and runs not in with_bicycles:
        tagged = tagged_width(of_side(tags, "cycleway", side, ":width"), 0.8, 4.0)
        found.append(_lane(side, "bicycle", tagged or Quantity(BICYCLE_WIDTH_M, "default"), runs))
    parked = _parking_width(tags, side)
    if parked is not None:
        found.append(_lane(side, "parking", parked, reverse))
    return found


def _lane(side: str, kind: LaneKind, width_m: Quantity, reverse: bool) -> LanePlan:
    return LanePlan(
        label=f"{kind}_{side}",
        reverse=reverse,
        number=_NUMBERS[kind, side],
        kind=kind,
        width_m=width_m,
        counted=False,
    )


def _parking_width(tags: Mapping[str, str], side: str) -> Quantity | None:
    """Return the width of the parking lane on a side, None where cars park elsewhere or not."""
    word = of_side(tags, "parking", side)
    if word is not None:
        if word not in _PARKED:
            return None
        orientation = of_side(tags, "parking", side, ":orientation")
        if tagged := tagged_width(of_side(tags, "parking", side, ":width"), 1.5, 8.0):
            return tagged
    else:
        # The scheme before 2022: parking:lane:right=parallel, its place in a key of its own.
        orientation = of_side(tags, "parking:lane", side)
        if orientation not in PARKING_WIDTH_M:
            return None
        place = of_side(tags, "parking:lane", side, f":{orientation}")
        if place is not None and place not in _OLD_ON_STREET:
            return None
    usual_m = PARKING_WIDTH_M.get(orientation or "", PARKING_WIDTH_M["parallel"])
    return Quantity(usual_m, "default")
