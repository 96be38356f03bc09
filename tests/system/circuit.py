"""The drawn town with a road that closes its route: a stand-in car drives laps for as long as it is
asked to, and is never off the map."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np

from foretwin.contracts.frames import geo_from_local
from foretwin.orchestrator.embedded import draw_town
from foretwin.orchestrator.embedded.draw_town import ORIGIN, Point

TAGS = {"highway": "secondary", "name": "Circular Road", "lanes": "2", "maxspeed": "50"}


def closing_road() -> list[Point]:
    """Return the road from the route's end, on the left around the town, to its beginning."""
    route = _route()
    bends = (_bend((300.0, 330.0), 40.0, -90, 90), _bend((-420.0, 310.0), 60.0, 90, 180))
    last = _bend((-420.0, 40.0), 60.0, 180, 270)
    return [route[-1], *bends[0], *bends[1], *last, route[0]]


def write_circuit(folder: Path, *, laps: int) -> tuple[Path, Path]:
    """Write the map and a route of so many laps; return their files."""
    town = draw_town.draw()
    town.way(closing_road(), TAGS)
    map_file, route_file = folder / "circuit.osm", folder / "circuit.geojson"
    map_file.write_text(draw_town.osm_xml(town), encoding="utf-8")
    lap = _route() + closing_road()
    points = [lap[0], *(there for here, there in pairwise(lap * laps) if here != there)]
    line = [[lon, lat] for lat, lon in geo_from_local(ORIGIN, np.array(points)).tolist()]
    route_file.write_text(json.dumps({"type": "LineString", "coordinates": line}), encoding="utf-8")
    return map_file, route_file


def _route() -> list[Point]:
    return draw_town.points_of(draw_town.described()["route"])


def _bend(centre: Point, radius_m: float, from_deg: int, to_deg: int) -> list[Point]:
    return [
        (centre[0] + radius_m * math.cos(angle), centre[1] + radius_m * math.sin(angle))
        for angle in map(math.radians, range(from_deg, to_deg + 1, 15))
    ]
