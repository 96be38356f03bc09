"""On which side of the road a country drives, by position."""

from __future__ import annotations

from collections import Counter
from functools import cache
from pathlib import Path

import shapely

from foretwin.contracts.world import DrivingSide
from foretwin.world_gen.osm.osm_map import OsmMap

LEFT_HAND_TRAFFIC = Path(__file__).with_name("left_hand_traffic.geojson")
"""Rough outlines of where traffic keeps left; they follow land borders within some tens of
kilometres. A `driving_side` tag in the map outranks them."""


def driving_side(osm: OsmMap) -> DrivingSide:
    """Return the side traffic keeps: from `driving_side` tags, else from the map's position."""
    tagged = Counter(
        tags["driving_side"]
        for tags in (*(way.tags for way in osm.ways.values()), *osm.node_tags.values())
        if tags.get("driving_side") in ("left", "right")
    )
    if tagged:
        return "left" if tagged["left"] > tagged["right"] else "right"
    return side_at(osm.frame.origin.lat_deg, osm.frame.origin.lon_deg)


def side_at(lat_deg: float, lon_deg: float) -> DrivingSide:
    """Return the side traffic keeps at a position, by rough outlines."""
    return "left" if shapely.contains_xy(_keeps_left(), lon_deg, lat_deg).any() else "right"


@cache
def _keeps_left() -> tuple[shapely.Geometry, ...]:
    outlines = shapely.from_geojson(LEFT_HAND_TRAFFIC.read_text(encoding="utf-8"))
    return tuple(outlines.geoms)
