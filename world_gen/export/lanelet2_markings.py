"""Which line Lanelet2 draws beside a lane; from it the library infers lane changes."""

from __future__ import annotations

from collections.abc import Sequence

from contracts.world import Lane, Road
from world_gen.export.lanelet2_primitives import Tags

VIRTUAL: Tags = {"type": "virtual"}
_UNMARKED_CLASSES = frozenset(
    {"residential", "living_street", "service", "track", "unclassified", "road", "pedestrian"}
)
"""Roads of these classes seldom have a middle line."""
_ROUND_KERB_CLASSES = frozenset({"motorway", "trunk", "motorway_link", "trunk_link", "track"})
"""Roads of these classes seldom have kerbs."""


def marking(
    lane: Lane, side: str, beside: Sequence[tuple[Lane, str]], road: Road | None
) -> dict[str, str]:
    """Return the tags of the border on the `side` of a lane, drawn in its driving direction.

    `beside` are the other lanes that the line bounds, each with the side on which they have it.
    """
    if not beside:
        kerbless = road is not None and road.road_class in _ROUND_KERB_CLASSES
        kerb = {"type": "curbstone", "subtype": "high"}
        return {"type": "road_border"} if kerbless else kerb
    other, its_side = beside[0]
    if its_side == side:  # driven the other way
        return _middle_line(road)
    left, right = (other, lane) if side == "left" else (lane, other)
    return _between(left, right)


def _between(left: Lane, right: Lane) -> dict[str, str]:
    """Return the line between lanes driven the same way, after what both may change to.

    `dashed_solid` is dashed on its left: only who is left of it may cross.
    """
    to_right = left.change in ("both", "right")
    to_left = right.change in ("both", "left")
    kind = "line_thin" if left.kind == right.kind else "line_thick"
    if to_right and to_left:
        return {"type": kind, "subtype": "dashed", "lane_change": "yes"}
    if to_right or to_left:
        return {"type": kind, "subtype": "dashed_solid" if to_right else "solid_dashed"}
    return {"type": kind, "subtype": "solid", "lane_change": "no"}


def _middle_line(road: Road | None) -> dict[str, str]:
    if road is None or road.road_class in _UNMARKED_CLASSES:
        return {**VIRTUAL, "lane_change": "no"}
    narrow = len(road.lane_ids) <= 2
    # One may overtake over a dashed line, but it parts no lanes that one could change between.
    return {
        "type": "line_thin",
        "subtype": "dashed" if narrow else "solid_solid",
        "lane_change": "no",
    }
