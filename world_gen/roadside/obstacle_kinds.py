"""What stands beside roads in OpenStreetMap: which tags mean it, how broad and high it is.

Tags as in https://wiki.openstreetmap.org/wiki/Key:barrier, Tag:natural=tree,
Tag:highway=street_lamp and Tag:amenity=shelter. Where a map says nothing, sizes are defaults:
what is usual in streets, from no norm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from foretwin.contracts.beside_road import ObstacleKind
from foretwin.contracts.provenance import Quantity
from foretwin.world_gen.buildings.tags import height_in_m


class UsualSize(NamedTuple):
    """Breadth across, and height above the road, of a kind that no tag says more of."""

    width_m: float
    height_m: float


TRAITS: Mapping[ObstacleKind, UsualSize] = {
    "tree": UsualSize(0.4, 8.0),
    "lamp": UsualSize(0.2, 6.0),
    "pole": UsualSize(0.25, 7.0),
    "bollard": UsualSize(0.15, 0.9),
    "block": UsualSize(0.6, 0.6),
    "wall": UsualSize(0.3, 1.8),
    "fence": UsualSize(0.1, 1.5),
    "hedge": UsualSize(0.8, 1.8),
    "guard_rail": UsualSize(0.3, 0.75),
    "shelter": UsualSize(1.5, 2.5),
}
SHELTER_LENGTH_M = 4.0
"""Of a bus shelter that is mapped as a point."""
_BARRIERS: Mapping[str, ObstacleKind] = {
    "wall": "wall",
    "city_wall": "wall",
    "retaining_wall": "wall",
    "jersey_barrier": "guard_rail",
    "guard_rail": "guard_rail",
    "fence": "fence",
    "hedge": "hedge",
}
_POSTS: Mapping[str, ObstacleKind] = {"bollard": "bollard", "block": "block"}
_THICKEST_M, _LOWEST_M = 5.0, 0.2


class Obstacle3d(NamedTuple):
    """What tags say of one: its kind, its breadth, its height."""

    kind: ObstacleKind
    width_m: float
    height_m: Quantity


def standing_at(tags: Mapping[str, str]) -> Obstacle3d | None:
    """Return what stands at a node; None where nothing does that a car could hit."""
    kind: ObstacleKind | None = None
    if tags.get("natural") == "tree":
        kind = "tree"
    elif tags.get("highway") == "street_lamp":
        kind = "lamp"
    elif tags.get("power") == "pole":
        kind = "pole"
    elif tags.get("amenity") == "shelter" or (
        tags.get("highway") == "bus_stop" and tags.get("shelter") == "yes"
    ):
        kind = "shelter"
    else:
        kind = _POSTS.get(tags.get("barrier", ""))
    if kind is None:
        return None
    around_m = height_in_m(tags.get("circumference"))
    across_m = around_m / math.pi if around_m else height_in_m(tags.get("diameter"))
    return _sized(kind, tags, across_m)


def standing_along(tags: Mapping[str, str]) -> Obstacle3d | None:
    """Return what stands along a way, or on its area; buildings are none."""
    if tags.get("building", "no") != "no" or "highway" in tags:
        return None
    kind = _BARRIERS.get(tags.get("barrier", ""))
    if kind is None and tags.get("amenity") == "shelter":
        kind = "shelter"
    return None if kind is None else _sized(kind, tags, height_in_m(tags.get("width")))


def _sized(kind: ObstacleKind, tags: Mapping[str, str], width_m: float | None) -> Obstacle3d | None:
    traits, tagged_m = TRAITS[kind], height_in_m(tags.get("height"))
    if tags.get("location") == "underground" or tags.get("layer", "0").startswith("-"):
        return None
    height = Quantity(traits.height_m, "default")
    if tagged_m is not None:
        height = Quantity(tagged_m, "tagged")
    if height.value < _LOWEST_M:
        return None
    return Obstacle3d(kind, min(width_m or traits.width_m, _THICKEST_M), height)
