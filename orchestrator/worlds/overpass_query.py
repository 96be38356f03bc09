"""What is asked of an Overpass endpoint for a box or along a line: all that Worlds are made of."""

from __future__ import annotations

import math

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import METRES_PER_DEG
from foretwin.world_gen.osm.osm_map import LatLonBounds
from foretwin.world_gen.osm.read_osm import NODE_TAGS, WAY_KEYS, WAY_TAGS

_POST_FILTERS = (
    '["highway"="street_lamp"]',
    '["highway"="bus_stop"]["shelter"]',
    '["barrier"~"^(bollard|block)$"]',
)
"""What stands beside roads at nodes of no way, by keys that nodes of roads have too."""
SIMPLIFIED_M = 20.0
"""A route is asked for within its margin plus this, so that fewer points say where it runs."""
MOST_POINTS = 2000


def parse_bbox(text: str) -> LatLonBounds:
    """Read W,S,E,N in degrees; UserError where it is no box."""
    try:
        west, south, east, north = (float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"{text}: a box is four numbers, W,S,E,N in degrees") from None
    if not (-90.0 <= south < north <= 90.0 and all(-180.0 <= v <= 180.0 for v in (west, east))):
        raise UserError(f"{text}: not a box W,S,E,N (south below north, within ±90 and ±180)")
    if west == east:
        raise UserError(f"{text}: the box has no width")
    return LatLonBounds(south, west, north, east)


def box_filter(box: LatLonBounds) -> str:
    """Return the Overpass filter of a box."""
    return f"({box.south:.7f},{box.west:.7f},{box.north:.7f},{box.east:.7f})"


def line_filter(lat_lon_deg: Array, margin_m: float) -> str:
    """Return the Overpass filter of everything within `margin_m` of a line (N, 2)."""
    line = np.asarray(lat_lon_deg, dtype=np.float64)
    scale = np.array([1.0, max(0.01, math.cos(math.radians(float(line[0, 0]))))]) * METRES_PER_DEG
    simple = shapely.LineString(line * scale).simplify(SIMPLIFIED_M)
    points = np.asarray(simple.coords) / scale
    if len(points) > MOST_POINTS:
        raise UserError(
            f"the route bends {len(points)} times; ask for at most {MOST_POINTS} points at a time, "
            "or for a box"
        )
    around = ",".join(f"{lat:.6f},{lon:.6f}" for lat, lon in points.tolist())
    return f"(around:{margin_m + SIMPLIFIED_M:.0f},{around})"


def overpass_query(area: str, *, timeout_s: int, max_bytes: int) -> str:
    """Return a query for all roads, rails, barriers, trees, posts and buildings of an area, whole.

    Ways come with all their nodes, buildings with all their outlines, and with them the turn
    restrictions that name one of the ways.
    """
    ways = "".join(f'way["{key}"]{area};' for key in WAY_KEYS)
    ways += "".join(f"way{_tag_filter(tag)}{area};" for tag in WAY_TAGS)
    posts = (*map(_tag_filter, NODE_TAGS), *_POST_FILTERS)
    nodes = "".join(f"node{tags}{area};" for tags in posts)
    return (
        f"[out:xml][timeout:{timeout_s}][maxsize:{max_bytes}];"
        f"({ways})->.w;"
        '(rel(bw.w)["type"~"^restriction"];rel(bw.w)["type"="building"];'
        f'rel["type"="multipolygon"]["building"]{area};'
        f'rel["type"="multipolygon"]["building:part"]{area};)->.r;'
        "(.w;way(r.r);)->.w;"
        f"(node(w.w);{nodes}.w;.r;);"
        "out body;"
    )


def _tag_filter(tag: str) -> str:
    key, value = tag.split("=")
    return f'["{key}"="{value}"]'
