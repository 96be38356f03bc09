"""Small maps drawn in metres around a place, written as OSM XML."""

from __future__ import annotations

import math
from pathlib import Path
from xml.sax.saxutils import quoteattr

from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_from_geo
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.osm.read_osm import read_map
from foretwin.world_gen.roads.build_graph import build_road_graph
from foretwin.world_gen.roads.road_graph import RoadGraph

NORTH_SEA_COAST = GeoPoint(53.5, 8.1)
MANCHESTER = GeoPoint(53.45, -2.3)


class Sketch:
    """Nodes at metres east and north of a place, and ways of their ids."""

    def __init__(self, place: GeoPoint = NORTH_SEA_COAST, bounds: str = "") -> None:
        self.frame = LocalFrame(place)
        self.bounds = bounds
        self.nodes: list[str] = []
        self.ways: list[str] = []
        self.relations: list[str] = []

    def node(self, node: int, x_m: float, y_m: float, **tags: str) -> int:
        lat, lon = geo_from_local(self.frame, [x_m, y_m]).tolist()  # type: ignore[arg-type]
        self.nodes.append(f'<node id="{node}" lat="{lat:.9f}" lon="{lon:.9f}">{_xml(tags)}</node>')
        return node

    def way(self, way: int, nodes: list[int], **tags: str) -> None:
        refs = "".join(f'<nd ref="{node}"/>' for node in nodes)
        self.ways.append(f'<way id="{way}">{refs}{_xml(tags)}</way>')

    def road(self, way: int, nodes: list[int], name: str = "", **tags: str) -> None:
        self.way(way, nodes, **{"highway": "residential", "name": name, **tags})

    def relation(self, relation: int, ways: dict[int, str], **tags: str) -> None:
        members = "".join(
            f'<member type="way" ref="{way}" role="{role}"/>' for way, role in ways.items()
        )
        self.relations.append(f'<relation id="{relation}">{members}{_xml(tags)}</relation>')

    def xml(self) -> str:
        parts = [self.bounds, *self.nodes, *self.ways, *self.relations]
        return f'<?xml version="1.0"?>\n<osm version="0.6">{"".join(parts)}</osm>\n'

    def read(self, folder: Path) -> OsmMap:
        path = folder / "sketch.osm"
        path.write_text(self.xml(), encoding="utf-8")
        return read_map(path)

    def graph(self, folder: Path) -> RoadGraph:
        return build_road_graph(self.read(folder))

    def junctions(self, folder: Path) -> tuple[Junction, ...]:
        osm = self.read(folder)
        return find_intersections(osm, build_road_graph(osm))


def _xml(tags: dict[str, str]) -> str:
    return "".join(
        f"<tag k={quoteattr(key.replace('__', ':'))} v={quoteattr(value)}/>"
        for key, value in tags.items()
        if value
    )


def star(bearings_deg: list[float], length_m: float = 150.0) -> Sketch:
    """Roads that meet in node 1."""
    sketch = Sketch()
    sketch.node(1, 0.0, 0.0)
    for arm, bearing in enumerate(bearings_deg, start=2):
        angle = math.radians(bearing)
        sketch.node(arm, length_m * math.cos(angle), length_m * math.sin(angle))
        sketch.road(100 + arm, [1, arm], f"Arm {arm}")
    return sketch


def only(junctions: tuple[Junction, ...]) -> Junction:
    assert len(junctions) == 1, [j.summary for j in junctions]
    return junctions[0]


def off_centre_m(sketch: Sketch, junction: Junction) -> float:
    """Return how far a junction's centre lies from the place the sketch is drawn around."""
    return math.hypot(*local_from_geo(sketch.frame, junction.summary.lat, junction.summary.lon))
