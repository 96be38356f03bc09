"""Draw a small junction in metres (x east, y north) and write it as OSM XML."""

from __future__ import annotations

import math
from pathlib import Path
from xml.sax.saxutils import quoteattr

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local

Point = tuple[float, float]

BREMEN = GeoPoint(53.08, 8.81)
LEEDS = GeoPoint(53.8, -1.55)
OHIO = GeoPoint(40.1, -82.9)
BERN = GeoPoint(46.95, 7.45)
LYON = GeoPoint(45.76, 4.84)

GERMAN = {"N": "Nordweg", "E": "Ostweg", "S": "Südweg", "W": "Westweg"}
ENGLISH = {"N": "North Road", "E": "East Road", "S": "South Road", "W": "West Road"}
ENDS: dict[str, Point] = {
    "N": (0.0, 120.0), "E": (120.0, 0.0), "S": (0.0, -120.0), "W": (-120.0, 0.0)
}  # fmt: skip


class Drawing:
    """One map: points become nodes once each, ways and restrictions refer to them."""

    def __init__(self, place: GeoPoint = BREMEN) -> None:
        self.frame = LocalFrame(place)
        self.nodes: dict[Point, tuple[int, dict[str, str]]] = {}
        self.ways: list[tuple[int, list[int], dict[str, str]]] = []
        self.relations: list[str] = []

    def node(self, x_m: float, y_m: float, **tags: str) -> int:
        """Return the id of the node at a point, made at first use, and tag it."""
        number, known = self.nodes.setdefault((x_m, y_m), (len(self.nodes) + 1, {}))
        known.update(tags)
        return number

    def way(self, name: str, highway: str, *points: Point, **tags: str) -> int:
        """Draw a road along points; `__` in a tag's key stands for a colon."""
        refs = [self.node(*point) for point in points]
        number = 101 + len(self.ways)
        self.ways.append((number, refs, {"highway": highway, "name": name, **tags}))
        return number

    def line(self, *points: Point, **tags: str) -> int:
        """Draw a way that is no road."""
        refs = [self.node(*point) for point in points]
        self.ways.append((101 + len(self.ways), refs, tags))
        return self.ways[-1][0]

    def arms(self, letters: str, highway: str, **tags: str) -> dict[str, int]:
        """Draw straight arms from their ends to the origin, named by the compass."""
        names = ENGLISH if self.frame.origin.lon_deg < 0 else GERMAN
        return {
            letter: self.way(names[letter], highway, ENDS[letter], (0.0, 0.0), **tags)
            for letter in letters
        }

    def restriction(self, kind: str, start: int, via: int | Point, end: int, **tags: str) -> None:
        """Add a turn restriction, by way of a point or of a way's id."""
        member = (
            f'<member type="way" ref="{via}" role="via"/>' if isinstance(via, int)
            else f'<member type="node" ref="{self.node(*via)}" role="via"/>'
        )  # fmt: skip
        self.relations.append(
            f'  <relation id="{901 + len(self.relations)}">'
            f'<member type="way" ref="{start}" role="from"/>{member}'
            f'<member type="way" ref="{end}" role="to"/>'
            f"{_tags({'type': 'restriction', 'restriction': kind, **tags})}</relation>"
        )

    def write(self, path: Path) -> None:
        """Write the map as OSM XML."""
        lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6">']
        for (x_m, y_m), (number, tags) in self.nodes.items():
            lat, lon = geo_from_local(self.frame, [x_m, y_m]).tolist()  # type: ignore[arg-type]
            lines.append(
                f'  <node id="{number}" lat="{lat:.8f}" lon="{lon:.8f}">{_tags(tags)}</node>'
            )
        for number, refs, tags in self.ways:
            nds = "".join(f'<nd ref="{ref}"/>' for ref in refs)
            lines.append(f'  <way id="{number}">{nds}{_tags(tags)}</way>')
        path.write_text("\n".join([*lines, *self.relations, "</osm>", ""]), encoding="utf-8")


def ring(radius_x_m: float, radius_y_m: float, clockwise: bool = False) -> list[Point]:
    """Return a closed ring of 24 points from (radius, 0) on, 15 degrees apart."""
    turns = [(-1 if clockwise else 1) * k * math.tau / 24 for k in range(24)]
    points = [
        (round(radius_x_m * math.cos(a), 3) + 0.0, round(radius_y_m * math.sin(a), 3) + 0.0)
        for a in turns
    ]
    return [*points, points[0]]


def _tags(tags: dict[str, str]) -> str:
    return "".join(
        f"<tag k={quoteattr(key.replace('__', ':'))} v={quoteattr(value)}/>"
        for key, value in tags.items()
        if value
    )
