"""Draws the embedded map and route: `python -m foretwin.orchestrator.embedded.draw_town [FOLDER]`.

The town is invented and lies in the open Atlantic, so that nobody takes it for a real place.
What is drawn where stands in `drawn_town.toml`, in metres east and north of the town's origin.
"""

from __future__ import annotations

import functools
import json
import math
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any
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
GAP_M = 4.0


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


@functools.cache
def described() -> Any:
    """Return what is drawn, as the file beside this module says it."""
    return tomllib.loads(MAP_FILE.with_suffix(".toml").read_text(encoding="utf-8"))


def points_of(words: str) -> list[Point]:
    """Return the points that words stand for: `x,y`, `ring3`, or the name of a line."""
    found: list[Point] = []
    for word in words.split():
        if word in described()["lines"]:
            found += points_of(described()["lines"][word])
        elif word.startswith("ring"):
            found.append(ring_point(int(word.removeprefix("ring"))))
        else:
            x, y = (float(number) for number in word.split(","))
            found.append((x, y))
    return found


def draw_streets(town: Drawing) -> None:
    """Draw the streets with their signs, signals and pedestrian crossings."""
    for way in described()["ways"]:
        town.way(points_of(way["line"]), way["tags"])
    for node in described()["nodes"]:
        for place in points_of(node["places"]):
            town.node(place, node["tags"])


def draw_buildings(town: Drawing) -> None:
    """Draw the rows of buildings, a few of them L-shaped, and a block around a courtyard."""
    houses, block = described()["buildings"], described()["courtyard"]
    sizes = zip(cycle(houses["widths_m"]), cycle(houses["depths_m"]), cycle(houses["tags"]))
    count = 0
    for x, y, heading_deg, number in houses["rows"]:
        along = np.array([math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))])
        inward = np.array([-along[1], along[0]])
        start = np.array((float(x), float(y)))
        for _ in range(number):
            width_m, depth_m, tags = next(sizes)
            corners = [(0.0, 0.0), (width_m, 0.0), (width_m, depth_m), (0.0, depth_m)]
            if count % 9 == 4:
                half_m = width_m / 2.0
                corners[2:3] = [(width_m, 6.0), (half_m, 6.0), (half_m, depth_m)]
            placed = [tuple((start + a * along + b * inward).tolist()) for a, b in corners]
            town.way([*placed, placed[0]], tags)
            start = start + (width_m + GAP_M) * along
            count += 1
    members = [(role, town.way(points_of(block[role]), {})) for role in ("outer", "inner")]
    town.relations.append((20_001, members, block["tags"]))


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
    route = points_of(described()["route"])
    points = [route[0]] + [there for here, there in pairwise(route) if here != there]
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
