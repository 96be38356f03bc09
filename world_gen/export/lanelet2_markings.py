"""Tags of a lane's border in Lanelet2, which infers lane changes from them."""

from __future__ import annotations

from foretwin.world_gen.export.lane_markings import Marking
from foretwin.world_gen.export.lanelet2_primitives import Tags

VIRTUAL: Tags = {"type": "virtual"}
_TYPES = {
    "thin": "line_thin",
    "thick": "line_thick",
    "kerb": "curbstone",
    "edge": "road_border",
    "none": "virtual",
}


def border_tags(marking: Marking) -> dict[str, str]:
    """Return the tags of a border that is drawn in the lane's driving direction."""
    tags = {"type": _TYPES[marking.paint]}
    if marking.paint == "kerb":
        tags["subtype"] = "high"
    if marking.pattern:
        tags["subtype"] = marking.pattern
    if marking.oncoming or marking.pattern == "solid":
        # One may overtake over a dashed middle line, but no one changes lanes over it.
        tags["lane_change"] = "no"
    elif marking.pattern == "dashed":
        tags["lane_change"] = "yes"
    return tags
