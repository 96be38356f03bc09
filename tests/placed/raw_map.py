"""A map as it stands in its file: roads and buildings in metres, read by pyosmium alone.

Nothing of foretwin is used here: what is counted or judged from it shares no code with what it
judges.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import osmium
import shapely

CAR_ROADS = frozenset(
    [
        "motorway",
        "trunk",
        "primary",
        "secondary",
        "tertiary",
        "unclassified",
        "residential",
        "living_street",
        "motorway_link",
        "trunk_link",
        "primary_link",
        "secondary_link",
        "tertiary_link",
    ]
)
_EQUATOR_M, _ECCENTRICITY_2 = 6_378_137.0, 6.69437999014e-3
"""Of the ellipsoid WGS 84."""
_MPH_MPS = 0.44704


class RawRoad(NamedTuple):
    """A way for cars: its nodes, their places (N, 2) in degrees (lon, lat), and its tags."""

    id: int
    nodes: tuple[int, ...]
    lon_lat: np.ndarray
    tags: dict[str, str]

    @property
    def oneway(self) -> int:
        """Return 1 where cars drive along the way's order alone, -1 against it, 0 both ways."""
        tag = self.tags.get("oneway", "")
        if tag in ("-1", "reverse"):
            return -1
        if tag in ("yes", "true", "1"):
            return 1
        round_ = self.tags.get("junction") in ("roundabout", "circular")
        fast = self.tags["highway"] in ("motorway", "motorway_link")
        return 1 if tag != "no" and (round_ or fast) else 0

    @property
    def below_buildings(self) -> bool:
        """Return whether a way leads through or under what is built."""
        tags = self.tags
        return tags.get("tunnel", "no") != "no" or tags.get("covered", "no") != "no"

    @property
    def tagged_mps(self) -> float | None:
        """Return the speed limit where the way has a number for one."""
        tag = self.tags.get("maxspeed", "")
        number, _, unit = tag.partition(" ")
        if not number.replace(".", "", 1).isdigit():
            return None
        return float(number) * (_MPH_MPS if unit == "mph" else 1.0 / 3.6)


class RawMap(NamedTuple):
    """The roads for cars of a map, its buildings as polygons of degrees, and its traffic lights."""

    roads: tuple[RawRoad, ...]
    buildings: tuple[shapely.Geometry, ...]
    lights: frozenset[int]
    """Nodes with traffic lights."""
    no_turns: tuple[dict[str, object], ...]
    """Turns that are forbidden, or the only ones: kind, from, via and to."""


def read_raw(file: Path) -> RawMap:
    """Read a map's roads, buildings on the ground, lights and turn restrictions."""
    reader = _Reader()
    reader.apply_file(str(file), locations=True, idx="flex_mem")
    return RawMap(
        tuple(reader.roads), tuple(reader.buildings), frozenset(reader.lights), tuple(reader.turns)
    )


class _Reader(osmium.SimpleHandler):
    def __init__(self) -> None:
        super().__init__()
        self.roads: list[RawRoad] = []
        self.buildings: list[shapely.Geometry] = []
        self.lights: set[int] = set()
        self.turns: list[dict[str, object]] = []
        self._made = osmium.geom.WKBFactory()

    def node(self, node: osmium.osm.Node) -> None:
        if node.tags.get("highway") == "traffic_signals":
            self.lights.add(node.id)

    def way(self, way: osmium.osm.Way) -> None:
        if way.tags.get("highway") not in CAR_ROADS or way.tags.get("area") == "yes":
            return
        places = [(n.ref, n.location) for n in way.nodes if n.location.valid()]
        if len(places) >= 2:
            lon_lat = np.array([[at.lon, at.lat] for _, at in places])
            nodes = tuple(ref for ref, _ in places)
            self.roads.append(RawRoad(way.id, nodes, lon_lat, dict(way.tags)))

    def area(self, area: osmium.osm.Area) -> None:
        tags = area.tags
        if tags.get("building", "no") in ("no", "roof", "carport") or _elsewhere(tags):
            return
        try:
            self.buildings.append(shapely.from_wkb(self._made.create_multipolygon(area)))
        except RuntimeError:
            return

    def relation(self, relation: osmium.osm.Relation) -> None:
        if relation.tags.get("type") == "restriction":
            members = {f"{m.role}": (m.type, m.ref) for m in relation.members}
            kind = relation.tags.get("restriction", "")
            self.turns.append({"kind": kind, **members})


def _elsewhere(tags: osmium.osm.TagList) -> bool:
    """Return whether a building leaves the ground free, or lies below it."""
    if tags.get("location") in ("underground", "overground") or "min_height" in tags:
        return True
    if tags.get("building:min_level", "0") != "0":
        return True
    return tags.get("layer", "0").startswith("-")


class Plane(NamedTuple):
    """Metres around a point, x east and y north, by the ellipsoid's radii there: true to a
    centimetre over some hundred metres."""

    lat_deg: float
    lon_deg: float

    def xy_m(self, lon_lat: np.ndarray) -> np.ndarray:
        """Return places (N, 2) of degrees in metres."""
        lat_rad = math.radians(self.lat_deg)
        flat = 1.0 - _ECCENTRICITY_2 * math.sin(lat_rad) ** 2
        east = _EQUATOR_M / math.sqrt(flat) * math.cos(lat_rad)
        north = _EQUATOR_M * (1.0 - _ECCENTRICITY_2) / flat**1.5
        per_rad = np.array([east, north])
        moved = np.asarray(lon_lat, dtype=float) - (self.lon_deg, self.lat_deg)
        return np.radians(moved) * per_rad

    def of(self, shape: shapely.Geometry) -> shapely.Geometry:
        """Return a shape of degrees in metres."""
        return shapely.transform(shape, self.xy_m)
