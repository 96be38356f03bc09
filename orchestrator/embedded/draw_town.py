"""Draws the embedded map and route: `python -m foretwin.orchestrator.embedded.draw_town [FOLDER]`.

The town is invented and lies in the open Atlantic, so that nobody takes it for a real place.
Coordinates below are metres east and north of the town's origin.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE

ORIGIN = LocalFrame(GeoPoint(45.0, -30.0))
NOTE = "drawn for foretwin, an invented town; not OpenStreetMap data"

Point = tuple[float, float]
Tags = dict[str, str]

RING_CENTRE: Point = (-90.0, 0.0)
RING_RADIUS_M = 15.0
RING_NODES = 16

LIME = {"highway": "secondary", "name": "Lime Street", "lanes": "2", "maxspeed": "50"}
LIME_WEST = LIME | {"name": "Lime Street West"}
LIME_EAST = LIME | {"name": "Lime Street East", "lanes": "4"}
HARBOUR = {"highway": "secondary", "name": "Harbour Road", "lanes": "2", "maxspeed": "50"}
HILL = {"highway": "tertiary", "name": "Hill Road", "lanes": "2", "maxspeed": "40"}
MILL = {"highway": "residential", "name": "Mill Lane", "lanes": "2", "maxspeed": "30"}
ABBEY = {"highway": "tertiary", "name": "Abbey Road", "lanes": "2", "maxspeed": "30"}
ORCHARD = {"highway": "residential", "name": "Orchard Lane", "width": "5.5", "maxspeed": "30"}

ZEBRA = {"highway": "crossing", "crossing": "uncontrolled", "crossing:markings": "zebra"}
SIGNAL_CROSSING = {"highway": "crossing", "crossing": "traffic_signals"}
SIGNAL = {"highway": "traffic_signals", "traffic_signals:direction": "forward"}
SIGNAL_BACKWARD = {"highway": "traffic_signals", "traffic_signals:direction": "backward"}
GIVE_WAY = {"highway": "give_way", "direction": "forward"}
GIVE_WAY_BACKWARD = {"highway": "give_way", "direction": "backward"}
STOP = {"highway": "stop", "direction": "forward"}

ROWS: tuple[tuple[Point, float, int], ...] = (
    ((-395.0, 14.0), 0.0, 3), ((-262.0, 14.0), 0.0, 4), ((-284.0, -38.0), 180.0, 3),
    ((-126.0, -14.0), 180.0, 4), ((-258.0, -46.0), 270.0, 2), ((-101.0, 42.0), 90.0, 2),
    ((-79.0, 118.0), 270.0, 2), ((-101.0, -118.0), 90.0, 2), ((-79.0, -44.0), 270.0, 2),
    ((-58.0, 14.0), 0.0, 5), ((-8.0, -16.0), 180.0, 2), ((97.0, 46.0), 90.0, 4),
    ((124.0, 172.0), 270.0, 4), ((142.0, 16.0), 0.0, 3), ((226.0, -16.0), 180.0, 3),
    ((97.0, -134.0), 90.0, 2), ((124.0, -46.0), 270.0, 2), ((2.0, 203.0), 0.0, 3),
    ((76.0, 177.0), 180.0, 2), ((132.0, 203.0), 0.0, 3), ((238.0, 177.0), 180.0, 3),
)  # fmt: skip
"""Rows of buildings: the first corner of the front, the heading along it (buildings stand to the
left), and how many."""

WIDTHS_M = (20.0, 26.0, 17.0, 23.0)
DEPTHS_M = (12.0, 14.0, 10.0)
GAP_M = 4.0
HEIGHTS: tuple[Tags, ...] = (
    {"building": "residential", "building:levels": "3"},
    {"building": "apartments", "height": "14.5"},
    {"building": "yes"},
    {"building": "retail", "building:levels": "2", "roof:levels": "1"},
    {"building": "house", "height": "8 m"},
)


@dataclass
class Drawing:
    """What has been drawn so far; a point drawn twice is one node."""

    nodes: dict[Point, int] = field(default_factory=dict)
    node_tags: dict[int, Tags] = field(default_factory=dict)
    ways: list[tuple[int, list[int], Tags]] = field(default_factory=list)
    relations: list[tuple[int, list[tuple[str, int]], Tags]] = field(default_factory=list)

    def node(self, point: Point, tags: Tags | None = None) -> int:
        """Return the id of the node at `point`, with `tags` added to it."""
        place = (round(point[0], 3), round(point[1], 3))
        node_id = self.nodes.setdefault(place, len(self.nodes) + 1)
        if tags:
            self.node_tags[node_id] = self.node_tags.get(node_id, {}) | tags
        return node_id

    def way(self, points: Sequence[Point], tags: Tags) -> int:
        """Draw a way and return its id."""
        way_id = 10_001 + len(self.ways)
        self.ways.append((way_id, [self.node(point) for point in points], tags))
        return way_id


def ring_point(index: int) -> Point:
    """Return ring node `index`, counted counter-clockwise from east."""
    angle = 2.0 * math.pi * index / RING_NODES
    x, y = RING_CENTRE
    return (x + RING_RADIUS_M * math.cos(angle), y + RING_RADIUS_M * math.sin(angle))


WEST_STREET: list[Point] = [(-400.0, -20.0), (-360.0, -17.0), (-310.0, -6.0), (-270.0, 0.0)]
MIDDLE_STREET: list[Point] = [(-270.0, 0.0), (-200.0, 0.0), (-135.0, 0.0)]
INTO_RING: list[Point] = [(-135.0, 0.0), (-122.0, -3.5), (-113.0, -5.0), ring_point(9)]
OUT_OF_RING: list[Point] = [ring_point(15), (-67.0, -5.0), (-58.0, -3.5), (-45.0, 0.0)]
TO_SIGNALS: list[Point] = [(-45.0, 0.0), (40.0, 0.0), (96.0, 0.0), (101.0, 0.0), (110.0, 0.0)]
NORTHWARD: list[Point] = [
    (110.0, 0.0), (110.0, 9.0), (110.0, 14.0), (110.0, 95.0), (110.0, 182.0), (110.0, 190.0),
]  # fmt: skip
CURVE: list[Point] = [(110.0, 190.0), (110.0, 230.0)] + [
    (170.0 - 60.0 * math.cos(a), 230.0 + 60.0 * math.sin(a))
    for a in np.radians(np.arange(15.0, 91.0, 15.0)).tolist()
] + [(270.0, 290.0)]  # fmt: skip

ROUTE: list[Point] = [
    *WEST_STREET, *MIDDLE_STREET, *INTO_RING, *(ring_point(i) for i in range(10, 15)),
    *OUT_OF_RING, *TO_SIGNALS, *NORTHWARD, *CURVE,
]  # fmt: skip


def draw_streets(town: Drawing) -> None:
    """Draw the streets with their signs, signals and pedestrian crossings."""
    # The T junction: Mill Lane stops at Lime Street West.
    town.way(WEST_STREET, LIME_WEST)
    town.way(MIDDLE_STREET, LIME_WEST)
    town.way([(-270.0, -140.0), (-270.0, -60.0), (-270.0, -7.0), (-270.0, 0.0)], MILL)
    town.node((-270.0, -7.0), STOP)

    # The roundabout: two arms part around splitter islands, two do not.
    ring = [ring_point(i % RING_NODES) for i in range(RING_NODES + 1)]
    town.way(ring, {"highway": "secondary", "junction": "roundabout", "lanes": "1",
                    "maxspeed": "30", "name": "Abbey Circle"})  # fmt: skip
    one_way = {"oneway": "yes", "lanes": "1"}
    town.way(INTO_RING, LIME_WEST | one_way)
    town.way([ring_point(7), (-113.0, 5.0), (-122.0, 3.5), (-135.0, 0.0)], LIME_WEST | one_way)
    town.way(OUT_OF_RING, LIME | one_way)
    town.way([(-45.0, 0.0), (-58.0, 3.5), (-67.0, 5.0), ring_point(1)], LIME | one_way)
    town.way([(-90.0, 140.0), (-90.0, 60.0), (-90.0, 24.0), ring_point(4)], ABBEY)
    town.way([(-90.0, -140.0), (-90.0, -60.0), (-90.0, -24.0), ring_point(12)], ABBEY)
    for place in ((-113.0, -5.0), (-67.0, 5.0), (-90.0, 24.0), (-90.0, -24.0)):
        town.node(place, GIVE_WAY)
    for place in ((-122.0, -3.5), (-122.0, 3.5), (-58.0, -3.5), (-58.0, 3.5)):
        town.node(place, ZEBRA)

    # The signalised crossing.
    town.way(TO_SIGNALS[:2], LIME)
    town.way(TO_SIGNALS[1:], LIME | {
        "lanes": "3", "lanes:forward": "2", "lanes:backward": "1",
        "turn:lanes:forward": "left|through;right",
    })  # fmt: skip
    town.way([(240.0, 0.0), (180.0, 0.0), (124.0, 0.0), (119.0, 0.0), (110.0, 0.0)], LIME_EAST | {
        "lanes:forward": "2", "lanes:backward": "2", "turn:lanes:forward": "left;through|right",
    })  # fmt: skip
    town.way([(110.0, -140.0), (110.0, -60.0)], HARBOUR)
    town.way([(110.0, -60.0), (110.0, -14.0), (110.0, -9.0), (110.0, 0.0)], HARBOUR | {
        "lanes": "3", "lanes:forward": "2", "lanes:backward": "1",
        "turn:lanes:forward": "left|through;right",
    })  # fmt: skip
    town.way(NORTHWARD, HARBOUR)
    for place in ((96.0, 0.0), (124.0, 0.0), (110.0, -14.0)):
        town.node(place, SIGNAL)
    town.node((110.0, 14.0), SIGNAL_BACKWARD)
    for place in ((101.0, 0.0), (119.0, 0.0), (110.0, -9.0), (110.0, 9.0)):
        town.node(place, SIGNAL_CROSSING)

    # The crossing where Orchard Lane gives way, and the curve up Hill Road.
    town.way([(-20.0, 190.0), (60.0, 190.0), (102.0, 190.0), (110.0, 190.0)], ORCHARD)
    town.way([(110.0, 190.0), (118.0, 190.0), (180.0, 190.0), (250.0, 190.0)], ORCHARD)
    town.way(CURVE, HILL)
    town.node((102.0, 190.0), GIVE_WAY)
    town.node((118.0, 190.0), GIVE_WAY_BACKWARD)
    town.node((110.0, 182.0), ZEBRA)


def draw_buildings(town: Drawing) -> None:
    """Draw the rows of buildings, a few of them L-shaped, and a block around a courtyard."""
    count = 0
    for corner, heading_deg, number in ROWS:
        along = np.array([math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))])
        inward = np.array([-along[1], along[0]])
        start = np.array(corner)
        for _ in range(number):
            width_m = WIDTHS_M[count % len(WIDTHS_M)]
            depth_m = DEPTHS_M[count % len(DEPTHS_M)]
            corners = [(0.0, 0.0), (width_m, 0.0), (width_m, depth_m), (0.0, depth_m)]
            if count % 9 == 4:
                half_m = width_m / 2.0
                corners[2:3] = [(width_m, 6.0), (half_m, 6.0), (half_m, depth_m)]
            placed = [tuple((start + a * along + b * inward).tolist()) for a, b in corners]
            town.way([*placed, placed[0]], HEIGHTS[count % len(HEIGHTS)])
            start = start + (width_m + GAP_M) * along
            count += 1
    outer: list[Point] = [(4.0, -60.0), (62.0, -60.0), (62.0, -16.0), (4.0, -16.0), (4.0, -60.0)]
    inner: list[Point] = [(16.0, -48.0), (16.0, -28.0), (50.0, -28.0), (50.0, -48.0), (16.0, -48.0)]
    members = [("outer", town.way(outer, {})), ("inner", town.way(inner, {}))]
    tags = {"type": "multipolygon", "building": "apartments", "building:levels": "5",
            "name": "Courtyard House"}  # fmt: skip
    town.relations.append((20_001, members, tags))


def draw() -> Drawing:
    """Return the whole town."""
    town = Drawing()
    draw_streets(town)
    draw_buildings(town)
    town.node((0.0, 240.0), {"place": "village", "name": "Drawn Town", "note": NOTE})
    return town


def _degrees(points: Sequence[Point]) -> list[tuple[float, float]]:
    """Return (lat, lon) of each point, to OpenStreetMap's precision of 1e-7° (1 cm)."""
    lat_lon = geo_from_local(ORIGIN, np.array(points))
    return [(round(lat, 7), round(lon, 7)) for lat, lon in lat_lon.tolist()]


def osm_xml(town: Drawing) -> str:
    """Return the town as OSM XML."""

    def tag_lines(tags: Tags) -> list[str]:
        return [f"    <tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in tags.items()]

    places = _degrees(list(town.nodes))
    lats, lons = [lat for lat, _ in places], [lon for _, lon in places]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<!-- {NOTE}: written by orchestrator/embedded/draw_town.py -->",
        f'<osm version="0.6" generator={quoteattr("foretwin draw_town: " + NOTE)}>',
        f'  <bounds minlat="{min(lats):.7f}" minlon="{min(lons):.7f}"'
        f' maxlat="{max(lats):.7f}" maxlon="{max(lons):.7f}"/>',
    ]
    for node_id, (lat, lon) in zip(town.nodes.values(), places, strict=True):
        head = f'  <node id="{node_id}" version="1" lat="{lat:.7f}" lon="{lon:.7f}"'
        tags = tag_lines(town.node_tags.get(node_id, {}))
        lines += [f"{head}>", *tags, "  </node>"] if tags else [f"{head}/>"]
    for way_id, refs, way_tags in town.ways:
        lines.append(f'  <way id="{way_id}" version="1">')
        lines += [f'    <nd ref="{ref}"/>' for ref in refs]
        lines += [*tag_lines(way_tags), "  </way>"]
    for relation_id, members, relation_tags in town.relations:
        lines.append(f'  <relation id="{relation_id}" version="1">')
        lines += [f'    <member type="way" ref="{ref}" role="{role}"/>' for role, ref in members]
        lines += [*tag_lines(relation_tags), "  </relation>"]
    return "\n".join([*lines, "</osm>", ""])


def route_geojson() -> str:
    """Return the main route as GeoJSON: one LineString, each point once."""
    points = [ROUTE[0]] + [there for here, there in pairwise(ROUTE) if here != there]
    line = [[lon, lat] for lat, lon in _degrees(points)]
    feature = {
        "type": "Feature",
        "properties": {"name": "Main route through the drawn town", "note": NOTE},
        "geometry": {"type": "LineString", "coordinates": line},
    }
    return json.dumps({"type": "FeatureCollection", "features": [feature]}, indent=1) + "\n"


def write(folder: Path) -> None:
    """Write map and route into `folder`."""
    (folder / MAP_FILE.name).write_text(osm_xml(draw()), encoding="utf-8")
    (folder / ROUTE_FILE.name).write_text(route_geojson(), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else MAP_FILE.parent)
