"""On which side of the road a country drives, by position."""

from __future__ import annotations

from collections import Counter

from foretwin.contracts.world import DrivingSide
from foretwin.world_gen.osm.osm_map import OsmMap

# Rough outlines (lon, lat) of where traffic keeps left; they follow land borders within some tens
# of kilometres. A `driving_side` tag in the map outranks them.
LEFT_HAND_OUTLINES: dict[str, tuple[tuple[float, float], ...]] = {
    "British Isles": (
        (-11.0, 51.0), (-7.0, 49.5), (-2.9, 49.1), (-1.95, 49.1), (-1.98, 49.78), (0.5, 50.35),
        (1.5, 50.98), (2.3, 51.6), (2.5, 53.0), (0.5, 55.5), (0.0, 61.2), (-9.0, 60.5),
        (-14.0, 57.5),
    ),
    "Malta": ((14.1, 35.7), (14.7, 35.7), (14.7, 36.2), (14.1, 36.2)),
    "Cyprus": ((32.2, 34.5), (34.7, 34.5), (34.7, 35.8), (32.2, 35.4)),
    "Japan": (
        (122.5, 23.8), (132.0, 23.8), (143.0, 24.0), (146.0, 43.3), (145.5, 44.5), (141.5, 45.7),
        (138.5, 43.0), (132.0, 36.5), (129.0, 34.9), (127.5, 32.5),
    ),
    "Australia": ((112.5, -44.0), (154.5, -44.0), (154.5, -24.0), (142.6, -10.3), (112.5, -20.5)),
    "New Zealand": ((166.0, -48.0), (179.9, -48.0), (179.9, -34.0), (166.0, -34.0)),
    "Pacific": ((177.0, -21.5), (179.9, -21.5), (179.9, -12.4), (177.0, -12.4)),
    "Papua New Guinea and the Solomons": (
        (141.0, -11.8), (163.0, -12.5), (163.0, -6.0), (153.0, -1.0), (141.0, -2.0),
    ),
    "Indonesia, Timor, Malaysia, Singapore, Brunei": (
        (95.0, 6.0), (98.0, -4.0), (105.0, -9.5), (119.0, -11.5), (128.0, -9.6), (141.0, -9.5),
        (141.0, -1.5), (129.0, 3.0), (119.5, 5.5), (117.2, 7.5), (109.0, 3.5), (104.8, 4.5),
        (102.0, 6.4), (99.6, 6.6),
    ),
    "Thailand": (
        (98.2, 7.5), (99.6, 6.5), (102.1, 6.2), (101.0, 11.5), (102.6, 11.7), (102.6, 13.6),
        (105.5, 14.3), (104.7, 16.6), (102.7, 17.8), (101.1, 17.6), (100.5, 20.3), (97.4, 18.5),
        (98.6, 16.1), (99.4, 12.0),
    ),
    "Hong Kong": ((113.83, 22.15), (114.42, 22.15), (114.42, 22.56), (114.05, 22.51)),
    "Macau": ((113.53, 22.1), (113.61, 22.1), (113.58, 22.215), (113.54, 22.215)),
    "South Asia": (
        (61.7, 25.0), (66.5, 24.4), (68.5, 22.0), (72.5, 18.0), (72.0, -1.0), (74.0, -1.0),
        (82.0, 5.5), (89.0, 21.5), (92.4, 20.7), (92.7, 22.0), (94.2, 24.0), (97.2, 28.0),
        (92.0, 27.9), (88.8, 28.2), (81.0, 30.2), (78.7, 31.7), (79.0, 34.5), (74.5, 36.9),
        (71.2, 36.2), (69.5, 33.5), (69.3, 31.9), (66.3, 29.9), (61.0, 29.6),
    ),
    "Southern and eastern Africa": (
        (11.7, -17.2), (15.0, -27.5), (18.0, -35.0), (27.0, -34.8), (33.5, -28.0), (36.0, -23.5),
        (41.0, -14.8), (40.6, -10.5), (39.8, -5.0), (41.6, -1.6), (41.9, 3.9), (35.9, 4.6),
        (34.0, 4.2), (30.9, 3.6), (29.6, -0.6), (30.5, -1.1), (30.8, -3.3), (29.5, -4.5),
        (30.8, -8.3),
        (28.7, -8.6), (29.8, -12.2), (27.2, -11.7), (24.3, -11.0), (22.0, -13.0), (22.0, -16.2),
        (23.4, -17.6), (18.5, -17.4),
    ),
    "Indian Ocean": (
        (55.0, -21.0), (64.0, -21.0), (64.0, -19.0), (57.0, -3.5), (46.0, -3.5), (55.2, -10.5),
    ),
    "Jamaica and the Caymans": (
        (-81.5, 17.6), (-76.1, 17.6), (-76.1, 18.6), (-79.5, 19.9), (-81.5, 19.5),
    ),
    "Bahamas and Turks": (
        (-79.0, 25.5), (-74.3, 20.8), (-71.0, 21.1), (-71.0, 22.0), (-77.0, 27.5), (-79.1, 26.9),
    ),
    "Lesser Antilles": (
        (-62.0, 10.0), (-60.4, 10.0), (-59.3, 12.9), (-60.7, 14.15), (-61.5, 14.15), (-61.9, 12.0),
    ),
    "Guyana and Suriname": (
        (-59.9, 8.4), (-54.0, 6.0), (-54.4, 4.0), (-54.6, 2.4), (-58.5, 1.3), (-59.9, 4.5),
        (-61.3, 6.0),
    ),
}  # fmt: skip


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
    """Return the side traffic keeps at a position, by the rough outlines above."""
    inside = (_contains(outline, lon_deg, lat_deg) for outline in LEFT_HAND_OUTLINES.values())
    return "left" if any(inside) else "right"


def _contains(outline: tuple[tuple[float, float], ...], x: float, y: float) -> bool:
    crossings = 0
    for (x0, y0), (x1, y1) in zip(outline, (*outline[1:], outline[0]), strict=True):
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) * (x1 - x0) / (y1 - y0):
            crossings += 1
    return crossings % 2 == 1
